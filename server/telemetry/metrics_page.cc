#include "server/telemetry/metrics_page.h"

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <utility>

namespace terrace::server {

MetricsPage::MetricsPage(std::function<std::string()> write, std::chrono::milliseconds age)
    : write_(std::move(write)), age_(age) {}

asio::awaitable<MetricsPage::Text> MetricsPage::Get() {
  co_return co_await asio::co_spawn(thread_, Make(this), asio::use_awaitable);
}

asio::awaitable<MetricsPage::Text> MetricsPage::Make(MetricsPage* self) {
  const auto now = std::chrono::steady_clock::now();
  if (!self->text_ || now - self->made_ >= self->age_) {
    self->text_ = std::make_shared<const std::string>(self->write_());
    self->made_ = now;
  }
  co_return self->text_;
}

void MetricsPage::Stop() { thread_.join(); }

}  // namespace terrace::server
