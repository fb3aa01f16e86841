// For tests of raster sources and of what opening them logs.
#pragma once

#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <memory>
#include <sstream>
#include <string>
#include <utility>

#include "engine/sources/raster_source.h"

namespace terrace::dem {

// On failure the test fails and the result is null.
inline std::shared_ptr<const RasterSource> OpenRasterOrFail(const std::string& path) {
  auto raster = RasterSource::Open(path);
  EXPECT_TRUE(raster.has_value()) << raster.error().message;
  return raster ? *std::move(raster) : nullptr;
}

// What is logged by a function.
template <typename Function>
std::string LogOf(const Function& function) {
  std::ostringstream text;
  const auto before = spdlog::default_logger();
  spdlog::set_default_logger(
      std::make_shared<spdlog::logger>("test", std::make_shared<spdlog::sinks::ostream_sink_mt>(text)));
  function();
  spdlog::set_default_logger(before);
  return text.str();
}

}  // namespace terrace::dem
