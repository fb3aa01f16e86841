#include "server/http/access_log.h"

#include <gtest/gtest.h>

namespace terrace::server {
namespace {

TEST(AccessLog, IsOneLineWhateverTheTargetHolds) {
  ReplyRecord record;
  record.method = "GET";
  record.target = "/a\"b\\c\r\nd \x1b[31m\xff";
  record.status = 200;
  record.body_bytes = 42;
  record.duration = std::chrono::microseconds(1234);
  record.cache = "hit";
  record.request_id = "0123456789abcdef";
  record.peer = "127.0.0.1:9";
  EXPECT_EQ(FormatAccessLine(record),
            "GET \"/a\\x22b\\x5cc\\x0d\\x0ad\\x20\\x1b[31m\\xff\" 200 42 B 1.234 ms cache=hit id=0123456789abcdef "
            "peer=127.0.0.1:9");
}

TEST(AccessLog, CutsLongTargets) {
  const std::string target(8000, 'a');
  ReplyRecord record;
  record.target = target;
  EXPECT_LT(FormatAccessLine(record).size(), kMaxLoggedTargetBytes + 100);
}

}  // namespace
}  // namespace terrace::server
