#include "fly/flight/flight.h"

#include <algorithm>
#include <memory>
#include <thread>

#include "engine/core/elapsed_time.h"
#include "fly/flight/client.h"

namespace terrace::fly {
namespace {

using Clock = std::chrono::steady_clock;

// Frames of every `step`-th client from `first`, until all have arrived.
void DrawFrames(const std::vector<std::unique_ptr<Client>>& clients, std::size_t first, std::size_t step,
                double frames_per_second, Clock::time_point start, const std::atomic<bool>& stop) {
  const auto period = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1 / frames_per_second));
  Clock::time_point due = start;
  bool any_flies = true;
  while (any_flies && !stop) {
    any_flies = false;
    const bool is_late = Clock::now() > due + period;
    if (is_late) due = Clock::now();
    for (std::size_t i = first; i < clients.size(); i += step) {
      if (clients[i]->phase() == Phase::kDone) continue;
      clients[i]->Frame(SecondsSince(start), is_late);
      any_flies = true;
    }
    due += period;
    std::this_thread::sleep_until(due);
  }
}

}  // namespace

void Fly(const FlightOptions& options, const std::atomic<bool>& stop,
         const std::function<void(std::size_t)>& each_second, Statistics& statistics) {
  const int cores = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  HttpOptions http_options = options.http;
  http_options.threads = std::min(cores, 4);
  http_options.clients = options.clients;
  http_options.headers_origin = options.document.origin;
  // In this order: replies that arrive at the end still find the workers.
  boost::asio::thread_pool workers(static_cast<std::size_t>(cores));
  HttpClient http(http_options);
  std::vector<std::unique_ptr<Client>> clients;
  for (int i = 0; i < options.clients; ++i) {
    clients.push_back(std::make_unique<Client>(options, i, http, workers, statistics));
  }
  const Clock::time_point start = Clock::now();
  std::atomic<int> running = std::min(cores, options.clients);
  const auto step = static_cast<std::size_t>(running.load());
  std::vector<std::jthread> threads;
  for (std::size_t i = 0; i < step; ++i) {
    threads.emplace_back([&, i] {
      DrawFrames(clients, i, step, options.frames_per_second, start, stop);
      --running;
    });
  }
  for (std::size_t second = 0; running > 0;) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    if (SecondsSince(start) < static_cast<double>(second + 1)) continue;
    each_second(second++);
  }
  threads.clear();
  for (const auto& client : clients) client->Finish();
}

}  // namespace terrace::fly
