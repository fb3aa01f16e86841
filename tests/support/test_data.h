// Real elevation models for tests. They are not part of the repository; tests that need them are skipped with a
// message.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace terrace::test_support {

// The path of a file in the folder that the environment variable TERRACE_TEST_DATA names, by default `../shared/data`
// beside the source tree. Nothing if there is no such file.
std::optional<std::string> TestDataPath(std::string_view name);

// The message of a skipped test: which file is missing and how to provide it.
std::string MissingTestData(std::string_view name);

// A window of the first band, row 0 as in the file; nodata is NaN.
struct TestRaster {
  int width = 0;
  int height = 0;
  std::vector<float> heights;
};

// A window at (x, y) of width x height samples, the whole raster if width is 0. Nothing if the file is missing, cannot
// be read, or does not contain the window.
std::optional<TestRaster> ReadTestRaster(std::string_view name, int x = 0, int y = 0, int width = 0, int height = 0);

}  // namespace terrace::test_support
