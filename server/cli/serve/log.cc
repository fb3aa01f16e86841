#include "server/cli/serve/log.h"

#include <fmt/format.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cstdint>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>

#include "server/telemetry/line_writer.h"

namespace terrace::cli {
namespace {

// %* : the message as a JSON string.
class JsonMessage final : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm&, spdlog::memory_buf_t& out) override {
    const std::string text(message.payload.data(), message.payload.size());
    const std::string quoted = nlohmann::json(text).dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
    out.append(quoted.data(), quoted.data() + quoted.size());
  }
  std::unique_ptr<custom_flag_formatter> clone() const override { return std::make_unique<JsonMessage>(); }
};

// Reports the number of dropped lines when the reader continues.
class StderrSink final : public spdlog::sinks::base_sink<std::mutex> {
 protected:
  void sink_it_(const spdlog::details::log_msg& message) override {
    if (!Put(message)) return;
    const std::uint64_t missed = server::LineWriter::Stderr().TakeMissed();
    if (missed == 0) return;
    const std::string note = fmt::format("dropped {} lines before the last one: stderr did not accept them", missed);
    Put({message.logger_name, spdlog::level::warn, note});
  }
  void flush_() override {}

 private:
  bool Put(const spdlog::details::log_msg& message) {
    spdlog::memory_buf_t line;
    formatter_->format(message, line);
    return server::LineWriter::Stderr().Write({line.data(), line.size()});
  }
};

// On a terminal: colours, and no time limit for the reader.
std::shared_ptr<spdlog::logger> MakeLogger(const std::string& name) {
  if (::isatty(STDERR_FILENO) != 0) return spdlog::stderr_color_mt(name);
  return std::make_shared<spdlog::logger>(name, std::make_shared<StderrSink>());
}

spdlog::level::level_enum LevelOf(config::LogLevel level) {
  constexpr spdlog::level::level_enum kLevels[] = {spdlog::level::debug, spdlog::level::info, spdlog::level::warn,
                                                   spdlog::level::err, spdlog::level::off};  // by value
  return kLevels[static_cast<std::size_t>(level)];
}

}  // namespace

void SetLogLevel(config::LogLevel level) {
  spdlog::default_logger_raw()->set_level(LevelOf(level));
  spdlog::log(LevelOf(level), "log level: {}", spdlog::level::to_string_view(LevelOf(level)));
}

void SetUpLog(config::LogLevel level, config::LogFormat format) {
  auto logger = MakeLogger("terrace");
  logger->set_level(LevelOf(level));
  if (format == config::LogFormat::kJson) {
    auto formatter = std::make_unique<spdlog::pattern_formatter>();
    formatter->add_flag<JsonMessage>('*').set_pattern(R"({"time":"%Y-%m-%dT%H:%M:%S.%e%z","level":"%l","message":%*})");
    logger->set_formatter(std::move(formatter));
  } else {
    logger->set_pattern("%Y-%m-%d %H:%M:%S.%e %^[%l]%$ %v");
  }
  spdlog::set_default_logger(std::move(logger));
}

}  // namespace terrace::cli
