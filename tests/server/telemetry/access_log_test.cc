#include "server/telemetry/access_log.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>

namespace terrace::server {
namespace {

const std::chrono::system_clock::time_point kNow{std::chrono::milliseconds(1'795'240'806'123)};

ReplyRecord Record() {
  ReplyRecord record;
  record.method = "GET";
  record.target = "/a\"b\\c\r\nd \x1b[31m\xff";
  record.status = 200;
  record.body_bytes = 42;
  record.duration = std::chrono::microseconds(1234);
  record.route = "tile";
  record.dataset = "maui";
  record.cache = "hit";
  record.request_id = "0123456789abcdef";
  record.peer = "127.0.0.1:9";
  return record;
}

TEST(AccessLog, IsOneLineWhateverTheTargetHolds) {
  EXPECT_EQ(FormatAccessLine(Record()),
            "GET \"/a...\" 200 42 B 1.234 ms cache=hit id=0123456789abcdef "
            "peer=127.0.0.1:9");
}

TEST(AccessLog, CutsLongTargets) {
  const std::string target(8000, 'a');
  ReplyRecord record;
  record.target = record.user_agent = record.referer = target;
  EXPECT_LT(FormatAccessLine(record).size(), kMaxLoggedBytes + 100);
  EXPECT_LT(FormatCombinedLine(record, kNow).size(), 3 * kMaxLoggedBytes + 100);
  EXPECT_LT(FormatJsonLine(record, kNow).size(), 3 * kMaxLoggedBytes + 300);
}

// The text in place of a name may be a token.
TEST(AccessLog, HidesLongPathsThatNameNothing) {
  const std::string token = "SECRETsecret0123456789";
  const auto shown = [&](std::string_view route, std::string_view dataset, int status, const std::string& target) {
    ReplyRecord record = Record();
    record.route = route;
    record.dataset = dataset;
    record.status = status;
    record.target = target;
    const std::string line = FormatAccessLine(record);
    return line.substr(0, line.find(' ', 4));
  };
  EXPECT_EQ(shown("layer", "", 404, "/" + token + "/layer.json"), "GET \"/.../layer.json\"");
  EXPECT_EQ(shown("tile", "", 401, "/" + token + "/0/0/0.terrain"), "GET \"/.../0/0/0.terrain\"");
  EXPECT_EQ(shown("heights", "", 401, "/" + token + "/heights?locations=1,1"), "GET \"/.../heights?locations=1,1\"");
  EXPECT_EQ(shown("viewer", "", 404, "/viewer/" + token), "GET \"/viewer/...\"");
  EXPECT_EQ(shown("viewer", "", 404, "/viewer/a/" + token + ".js"), "GET \"/viewer/a/...\"");
  EXPECT_EQ(shown("viewer", "", 304, "/viewer/index-0123456789abcdef.js"), "GET \"/viewer/index-0123456789abcdef.js\"");
  EXPECT_EQ(shown("tile", "a-dataset-with-a-long-name", 200, "/a-dataset-with-a-long-name/0/0/0.terrain"),
            "GET \"/a-dataset-with-a-long-name/0/0/0.terrain\"");
}

TEST(AccessLog, HasTheCombinedForm) {
  ReplyRecord record = Record();
  record.user_agent = "Mozilla/5.0 (\"x\")";
  record.version = 10;
  EXPECT_EQ(
      FormatCombinedLine(record, kNow),
      "127.0.0.1 - - [21/Nov/2026:06:00:06 +0000] \"GET /a... HTTP/1.0\" 200 42 \"-\" \"Mozilla/5.0 (\\x22x\\x22)\"");
  record.peer = "::1:4242";
  EXPECT_TRUE(FormatCombinedLine(record, kNow).starts_with("::1 - - ["));
}

TEST(AccessLog, HasAJsonForm) {
  ReplyRecord record = Record();
  record.referer = "http://x/\"\n";
  const std::string line = FormatJsonLine(record, kNow);
  EXPECT_EQ(line.find('\n'), std::string::npos);
  const auto json = nlohmann::json::parse(line);
  EXPECT_EQ(json["time"], "2026-11-21T06:00:06.123Z");
  EXPECT_EQ(json["client"], "127.0.0.1");
  EXPECT_EQ(json["target"], "/a...");
  EXPECT_EQ(json["protocol"], "HTTP/1.1");
  EXPECT_EQ(json["status"], 200);
  EXPECT_EQ(json["bytes"], 42);
  EXPECT_EQ(json["seconds"], 0.001234);
  EXPECT_EQ(json["dataset"], "maui");
  EXPECT_EQ(json["referer"], "http://x/...");
}

std::string TextOf(const std::filesystem::path& file) {
  std::ifstream in(file);
  return {std::istreambuf_iterator<char>(in), {}};
}

TEST(AccessLog, AppendsToItsFileAndFollowsARotation) {
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / ("access_log_" + std::to_string(::getpid()));
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  EXPECT_TRUE(AccessLog::Try(config::AccessLogForm::kCombined, folder / "access.log"));
  EXPECT_TRUE(std::filesystem::is_empty(folder));
  EXPECT_FALSE(AccessLog::Try(config::AccessLogForm::kCombined, folder));
  auto log = AccessLog::Open(config::AccessLogForm::kCombined, folder / "access.log");
  ASSERT_TRUE(log) << log.error().message;
  log->Write(Record());
  std::filesystem::rename(folder / "access.log", folder / "access.log.1");
  log->Write(Record());
  log->Reopen();
  log->Write(Record());
  const std::string old = TextOf(folder / "access.log.1"), now = TextOf(folder / "access.log");
  EXPECT_EQ(std::count(old.begin(), old.end(), '\n'), 2);
  EXPECT_EQ(std::count(now.begin(), now.end(), '\n'), 1);
  std::filesystem::remove_all(folder);
  log->Reopen();  // fails, so the old file stays in use
  log->Write(Record());
  EXPECT_FALSE(AccessLog::Try(config::AccessLogForm::kJson, folder / "nothing" / "access.log"));
  EXPECT_FALSE(AccessLog::Open(config::AccessLogForm::kJson, folder / "nothing" / "access.log"));
}

// A reader of a pipe would see the end of the pipe after the first writer.
TEST(AccessLog, IsTriedWithoutATrace) {
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / ("access_log_try_" + std::to_string(::getpid()));
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  const std::filesystem::path pipe = folder / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  const int reader = ::open(pipe.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  ASSERT_GE(reader, 0);
  EXPECT_TRUE(AccessLog::Try(config::AccessLogForm::kJson, pipe));
  pollfd end{reader, POLLIN, 0};
  EXPECT_EQ(::poll(&end, 1, 0), 0) << end.revents;
  EXPECT_TRUE(AccessLog::Open(config::AccessLogForm::kJson, pipe));
  ::close(reader);

  std::filesystem::create_symlink("there.log", folder / "here");
  EXPECT_TRUE(AccessLog::Try(config::AccessLogForm::kJson, folder / "here"));
  EXPECT_FALSE(std::filesystem::exists(folder / "there.log"));
  std::filesystem::create_symlink(folder / "nothing" / "access.log", folder / "astray");
  EXPECT_FALSE(AccessLog::Try(config::AccessLogForm::kJson, folder / "astray"));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace terrace::server
