// HTTPS: supported and refused versions, and certificates that change.
#include "server/net/tls.h"

#include <gtest/gtest.h>
#include <openssl/ssl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <thread>

#include "tests/server/server_fixture.h"
#include "tests/server/tls_client.h"

namespace terrace::server {
namespace {

using namespace std::chrono_literals;

const std::string kAsk = "GET /livez HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n";

class Tls : public ServerFixture {
 protected:
  Tls() {
    std::filesystem::create_directories(directory_);
    WriteCertificate("first.example", certificate_, key_);
  }
  ~Tls() override {
    server_.reset();
    std::filesystem::remove_all(directory_);
  }
  void StartTls(ServerOptions options = {}) {
    options.config.tls.certificate = certificate_;
    options.config.tls.key = key_;
    Start(options);
  }

  const std::string directory_ = testing::TempDir() + "terrace_tls_" + std::to_string(::getpid());
  const std::string certificate_ = directory_ + "/server.pem", key_ = directory_ + "/server.key";
};

TEST_F(Tls, ServesTheSameReplies) {
  StartTls();
  EXPECT_TRUE(server_->url().starts_with("https://"));
  const TlsReply reply = FetchTls(port(), kAsk);
  ASSERT_TRUE(reply.secured);
  EXPECT_EQ(reply.version, "TLSv1.3");
  EXPECT_EQ(reply.protocol, "http/1.1");
  EXPECT_EQ(reply.subject, "first.example");
  EXPECT_TRUE(reply.bytes.starts_with("HTTP/1.1 200 OK\r\n")) << reply.bytes;
  EXPECT_TRUE(reply.bytes.ends_with("\r\n\r\nok\n")) << reply.bytes;
  const std::string tiles = FetchTls(port(), "GET /maui/tiles.json HTTP/1.0\r\nHost: h\r\n\r\n").bytes;
  EXPECT_NE(tiles.find("\"https://h/maui/"), std::string::npos) << tiles;
}

TEST_F(Tls, SendsLongRepliesWhole) {
  builder_ = [](const tiler::TileRequest&, std::stop_token) -> Result<tiler::EncodedTile> {
    tiler::EncodedTile tile;
    for (int i = 0; i < 1'000'000; ++i) tile.bytes += std::to_string(i);
    return tile;
  };
  StartTls();
  const TlsReply reply = FetchTls(port(), "GET /maui/0/0/0.terrain HTTP/1.0\r\n\r\n");
  const std::size_t body = reply.bytes.find("\r\n\r\n") + 4;
  ASSERT_EQ(reply.bytes.size() - body, 5'888'890u);
  EXPECT_TRUE(reply.bytes.ends_with("999998999999"));
}

TEST_F(Tls, RefusesWhatIsOld) {
  StartTls();
  EXPECT_EQ(FetchTls(port(), kAsk, TLS1_2_VERSION).version, "TLSv1.2");
  EXPECT_FALSE(FetchTls(port(), kAsk, TLS1_1_VERSION).secured);
  EXPECT_FALSE(FetchTls(port(), kAsk, TLS1_2_VERSION, "AES128-SHA:AES256-GCM-SHA384").secured) << "no forward secrecy";
  EXPECT_FALSE(FetchTls(port(), kAsk, TLS1_2_VERSION, "ECDHE-ECDSA-AES128-SHA").secured) << "CBC";
}

TEST_F(Tls, ClosesWhoDoesNotSpeakIt) {
  ServerOptions options;
  options.config.header_timeout = 300ms;
  StartTls(options);
  RawClient plain(port());
  plain.Send(Get("/livez"));
  const auto reply = plain.Read();
  EXPECT_TRUE(!reply || reply->status == -1) << "at most an alert";
  RawClient silent(port());
  EXPECT_TRUE(silent.Ended());
}

TEST_F(Tls, StopsBuildsOfClientsThatLeave) {
  std::atomic<bool> begun{false}, stopped{false};
  builder_ = [&](const tiler::TileRequest&, std::stop_token stop) -> Result<tiler::EncodedTile> {
    begun = true;
    stopped = Eventually([&] { return stop.stop_requested(); });
    return MakeError(ErrorCode::kCancelled, "stopped");
  };
  StartTls();
  LeaveTls(port(), "GET /maui/0/0/0.terrain HTTP/1.1\r\nHost: x\r\n\r\n",
           [&] { Eventually([&] { return begun.load(); }); });
  EXPECT_TRUE(Eventually([&] { return stopped.load(); }));
  server_.reset();
}

TEST_F(Tls, TakesANewCertificateAndKeepsTheOldWhereTheNewIsWrong) {
  StartTls();
  ASSERT_EQ(FetchTls(port(), kAsk).subject, "first.example");
  std::ofstream(certificate_) << "nonsense";
  std::this_thread::sleep_for(3s);
  EXPECT_EQ(FetchTls(port(), kAsk).subject, "first.example");
  WriteCertificate("second.example", certificate_, key_);
  EXPECT_TRUE(Eventually([&] { return FetchTls(port(), kAsk).subject == "second.example"; }));
}

// Without memory, descriptors or permission the new files cannot be read at the first attempt.
TEST_F(Tls, TriesFilesAgainThatCouldNotBeRead) {
  const auto tls = *TlsContext::Open(certificate_, key_);
  WriteCertificate("second.example", certificate_, key_);
  rlimit limit{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &limit), 0);
  const rlimit none{0, limit.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  const Result<bool> failed = tls->ReloadIfChanged();
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &limit), 0);
  EXPECT_FALSE(failed);
  EXPECT_TRUE(*tls->ReloadIfChanged());
  EXPECT_FALSE(*tls->ReloadIfChanged());
}

TEST_F(Tls, TriesFilesAgainWhosePermissionsHaveChanged) {
  const auto tls = *TlsContext::Open(certificate_, key_);
  std::this_thread::sleep_for(20ms);  // longer than the granularity of times of files
  std::filesystem::permissions(key_, std::filesystem::perms::owner_read);
  EXPECT_TRUE(*tls->ReloadIfChanged());
}

// OpenSSL would ask for the passphrase on the terminal, or else read it from standard input.
TEST_F(Tls, AsksNobodyForAPassphrase) {
  WriteCertificate("first.example", certificate_, key_, "secret");
  int input[2];
  ASSERT_EQ(::pipe(input), 0);
  ASSERT_EQ(::write(input[1], "secret\n", 7), 7);
  ::close(input[1]);
  const int kept = ::dup(0);
  ::dup2(input[0], 0);
  const auto tls = TlsContext::Open(certificate_, key_);
  ::dup2(kept, 0);
  char answer[8];
  EXPECT_EQ(::read(input[0], answer, sizeof answer), 7) << "the answer was taken";
  ::close(input[0]);
  ::close(kept);
  ASSERT_FALSE(tls);
  EXPECT_TRUE(tls.error().message.starts_with(key_ + ": cannot be used for TLS")) << tls.error().message;
  EXPECT_TRUE(tls.error().message.ends_with("the key without a passphrase")) << tls.error().message;
}

TEST_F(Tls, SaysWhichFileIsWrong) {
  WriteCertificate("other.example", directory_ + "/other.pem", directory_ + "/other.key");
  ServerOptions options;
  options.config.tls.certificate = certificate_;
  options.config.tls.key = directory_ + "/other.key";
  const auto mismatched = Server::Start(options);
  ASSERT_FALSE(mismatched);
  EXPECT_EQ(mismatched.error().message,
            directory_ + "/other.key: is not the key of the certificate in " + certificate_);
  options.config.tls.certificate = key_;
  const auto swapped = Server::Start(options);
  ASSERT_FALSE(swapped);
  EXPECT_NE(swapped.error().message.find("server.key"), std::string::npos) << swapped.error().message;
}

}  // namespace
}  // namespace terrace::server
