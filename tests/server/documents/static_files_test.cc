#include "server/documents/static_files.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

#include "proto/compress.h"

namespace terrace::server {
namespace {

namespace fs = std::filesystem;

class StaticFilesTest : public testing::Test {
 protected:
  StaticFilesTest() : folder_(fs::temp_directory_path() / ("terrace_static_" + std::to_string(::getpid()))) {
    fs::create_directories(folder_ / "js");
  }
  ~StaticFilesTest() override { fs::remove_all(folder_); }
  void Write(const char* name, const std::string& bytes) { std::ofstream(folder_ / name, std::ios::binary) << bytes; }

  const fs::path folder_;
};

TEST_F(StaticFilesTest, LoadsTheTreeWithItsTypes) {
  Write("index.html", "<html>");
  Write("js/app.js", "x()");
  const Result<StaticFiles> files = StaticFiles::Load(folder_);
  ASSERT_TRUE(files);
  ASSERT_NE(files->Find("index.html"), nullptr);
  EXPECT_EQ(files->Find("index.html")->content_type, "text/html; charset=utf-8");
  EXPECT_EQ(*files->Find("js/app.js")->identity, "x()");
  EXPECT_EQ(files->Find("../etc/passwd"), nullptr);
  EXPECT_EQ(files->Find(""), nullptr);
}

TEST_F(StaticFilesTest, ServesTheCompressedSiblingToThoseWhoTakeIt) {
  Write("a.js", std::string(100, 'a'));
  const std::string compressed = proto::Gzip(std::string(100, 'a'));
  Write("a.js.gz", compressed);
  Write("b.js", "new");
  Write("b.js.gz", proto::Gzip("old"));
  Write("alone.gz", "an archive");
  const Result<StaticFiles> files = StaticFiles::Load(folder_);
  ASSERT_TRUE(files);
  Request request;
  EXPECT_EQ(Serve(*files->Find("a.js"), request, "").body->size(), 100u);
  request.fields.Set(&RequestFields::accept_encoding, "gzip");
  const Response gzip = Serve(*files->Find("a.js"), request, "");
  EXPECT_EQ(*gzip.body, compressed);
  EXPECT_EQ(gzip.content_encoding, "gzip");
  EXPECT_EQ(files->Find("a.js.gz"), nullptr);
  EXPECT_NE(files->Find("alone.gz"), nullptr);
  const Response changed = Serve(*files->Find("b.js"), request, "");
  EXPECT_EQ(changed.content_encoding == "gzip" ? proto::Gunzip(*changed.body, 100) : *changed.body, "new");
}

TEST_F(StaticFilesTest, IsEmptyWithoutAFolder) {
  EXPECT_TRUE(StaticFiles::Load(folder_ / "missing")->empty());
  EXPECT_TRUE(StaticFiles::Load("")->empty());
}

}  // namespace
}  // namespace terrace::server
