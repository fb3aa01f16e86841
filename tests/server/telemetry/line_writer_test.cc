#include "server/telemetry/line_writer.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <climits>
#include <csignal>
#include <cstddef>
#include <string>
#include <thread>

namespace terrace::server {
namespace {

class Pipe {
 public:
  Pipe() {
    EXPECT_EQ(::pipe2(ends_.data(), O_CLOEXEC), 0);
    ::signal(SIGPIPE, SIG_IGN);
  }
  ~Pipe() {
    CloseReader();
    ::close(ends_[1]);
  }
  int writer() const { return ends_[1]; }
  void CloseReader() {
    if (ends_[0] >= 0) ::close(ends_[0]);
    ends_[0] = -1;
  }
  void Take(std::size_t most) {
    std::string part(most, ' ');
    ::fcntl(ends_[0], F_SETFL, O_NONBLOCK);
    static_cast<void>(::read(ends_[0], part.data(), most) > 0);
  }
  // Content of the file.
  std::string Read() {
    ::fcntl(ends_[0], F_SETFL, O_NONBLOCK);
    std::string text;
    std::array<char, 65536> part;
    for (ssize_t size = 0; (size = ::read(ends_[0], part.data(), part.size())) > 0;) {
      text.append(part.data(), static_cast<std::size_t>(size));
    }
    return text;
  }

 private:
  std::array<int, 2> ends_ = {-1, -1};
};

std::string Line(char letter, std::size_t size) { return std::string(size - 1, letter) + '\n'; }

TEST(LineWriter, WritesLines) {
  Pipe pipe;
  LineWriter writer(pipe.writer());
  EXPECT_TRUE(writer.Write("one\n"));
  EXPECT_TRUE(writer.Write(Line('x', 3 * PIPE_BUF + 7)));
  EXPECT_EQ(pipe.Read(), "one\n" + Line('x', 3 * PIPE_BUF + 7));
  EXPECT_EQ(writer.TakeMissed(), 0U);
}

// The pipe is full; the test passes if this ends.
TEST(LineWriter, DoesNotWaitForAReaderThatStallsAndCountsWhatHeMisses) {
  Pipe pipe;
  LineWriter writer(pipe.writer());
  std::string written;
  std::size_t missed = 0;
  for (int i = 0; i < 3000; ++i) {
    const std::string line = Line(static_cast<char>('a' + i % 26), 100);
    writer.Write(line) ? written += line : (++missed, "");
  }
  EXPECT_GT(missed, 0U);
  EXPECT_EQ(pipe.Read(), written);
  EXPECT_EQ(writer.TakeMissed(), missed);
  EXPECT_EQ(writer.TakeMissed(), 0U);
  EXPECT_TRUE(writer.Write("again\n"));
  EXPECT_EQ(pipe.Read(), "again\n");
}

// A reader that reads a little from time to time must not block forever.
TEST(LineWriter, DoesNotFollowAReaderWhoIsSlow) {
  Pipe pipe;
  LineWriter writer(pipe.writer());
  const std::jthread reader([&pipe](const std::stop_token& done) {
    while (!done.stop_requested()) {
      pipe.Take(4096);
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  });
  for (int i = 0; i < 20'000; ++i) writer.Write(Line('x', 100));
  EXPECT_GT(writer.TakeMissed(), 1000U);
}

TEST(LineWriter, EndsALineThatWasCut) {
  Pipe pipe;
  LineWriter writer(pipe.writer());
  const std::string large = Line('x', std::size_t{1} << 20);
  EXPECT_FALSE(writer.Write(large));
  const std::string begun = pipe.Read();
  EXPECT_LT(begun.size(), large.size());
  EXPECT_EQ(begun, std::string(begun.size(), 'x'));
  EXPECT_TRUE(writer.Write("next\n"));
  EXPECT_EQ(pipe.Read(), "\nnext\n");
}

TEST(LineWriter, OutlivesItsReader) {
  Pipe pipe;
  LineWriter writer(pipe.writer());
  pipe.CloseReader();
  EXPECT_FALSE(writer.Write("one\n"));
  EXPECT_FALSE(writer.Write("two\n"));
  EXPECT_EQ(writer.TakeMissed(), 2U);
}

TEST(LineWriter, TellsOfAFullDisk) {
  const int full = ::open("/dev/full", O_WRONLY | O_CLOEXEC);
  ASSERT_GE(full, 0);
  LineWriter writer(full);
  EXPECT_FALSE(writer.Write("one\n"));
  EXPECT_EQ(writer.TakeMissed(), 1U);
  ::close(full);
}

}  // namespace
}  // namespace terrace::server
