#include "server/store/password_file.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <string>

namespace terrace::server {
namespace {

TEST(ReadPassword, ReturnsTheFirstLineWithoutItsEnd) {
  const std::string file = testing::TempDir() + "password_file_test_" + std::to_string(::getpid());
  for (const char* const text : {"se cret", "se cret\n", "se cret\r\n", "se cret\r\nof two lines\r\n"}) {
    std::ofstream(file, std::ios::binary) << text;
    EXPECT_EQ(ReadPassword(file).value_or("unreadable"), "se cret");
  }
  for (const char* const text : {"", "\n", "\r\n"}) {
    std::ofstream(file, std::ios::binary) << text;
    EXPECT_FALSE(ReadPassword(file));
  }
  std::ofstream(file, std::ios::binary) << std::string(5000, 'x') << '\n';
  EXPECT_EQ(ReadPassword(file).error().code, ErrorCode::kInvalidArgument) << "no password is cut";
  std::remove(file.c_str());
  const auto missing = ReadPassword(file);
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::kUnavailable);
  EXPECT_NE(missing.error().message.find(file), std::string::npos) << missing.error().message;
}

}  // namespace
}  // namespace terrace::server
