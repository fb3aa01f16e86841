#include "server/telemetry/metrics_page.h"

#include <gtest/gtest.h>

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <exception>
#include <future>
#include <thread>
#include <vector>

namespace terrace::server {
namespace {

using namespace std::chrono_literals;

// The texts that `scrapers` on one thread get.
std::vector<MetricsPage::Text> Scrape(MetricsPage& page, int scrapers, asio::io_context& io) {
  std::vector<MetricsPage::Text> texts;
  for (int i = 0; i < scrapers; ++i) {
    asio::co_spawn(io, page.Get(), [&](const std::exception_ptr& error, MetricsPage::Text text) {
      EXPECT_FALSE(error);
      texts.push_back(std::move(text));
    });
  }
  io.run();
  return texts;
}

TEST(MetricsPage, IsMadeOnceForAllWhoAskWithinItsAge) {
  int made = 0;
  MetricsPage page([&] { return std::to_string(++made); }, 1h);
  asio::io_context io;
  const std::vector<MetricsPage::Text> texts = Scrape(page, 6, io);
  ASSERT_EQ(texts.size(), 6u);
  for (const MetricsPage::Text& text : texts) EXPECT_EQ(text, texts[0]);
  EXPECT_EQ(made, 1);
  page.Stop();
}

TEST(MetricsPage, IsMadeAnewWhenItHasAged) {
  int made = 0;
  MetricsPage page([&] { return std::to_string(++made); }, 0ms);
  asio::io_context io;
  const std::vector<MetricsPage::Text> texts = Scrape(page, 2, io);
  ASSERT_EQ(texts.size(), 2u);
  EXPECT_EQ(*texts[0] + *texts[1], "12");
  page.Stop();
}

TEST(MetricsPage, LeavesTheThreadThatAsksFree) {
  std::promise<void> went_on;
  MetricsPage page(
      [&] {
        EXPECT_EQ(went_on.get_future().wait_for(60s), std::future_status::ready);
        return std::string();
      },
      1h);
  asio::io_context io;
  asio::co_spawn(io, page.Get(), [](const std::exception_ptr&, const MetricsPage::Text&) {});
  asio::post(io, [&] { went_on.set_value(); });
  io.run();
  page.Stop();
}

}  // namespace
}  // namespace terrace::server
