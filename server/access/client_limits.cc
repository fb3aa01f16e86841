#include "server/access/client_limits.h"

#include <spdlog/spdlog.h>

#include <boost/asio/steady_timer.hpp>
#include <boost/asio/this_coro.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <utility>

namespace terrace::server {

ClientLimits::ClientLimits(const config::Config& config, AdmissionOptions admission)
    : connections(config.max_connections, config.max_connections_per_client),
      transfers(config.transfer_bytes),
      admission_control(std::move(admission)),
      cors(config.cors_origins) {}

Result<std::unique_ptr<ClientLimits>> ClientLimits::Open(const config::Config& config) {
  AdmissionOptions admission;
  Result<AddressRanges> trusted = AddressRanges::Parse(config.trusted_proxies);
  if (!trusted) return tl::unexpected(std::move(trusted.error()));
  admission.proxies = {*std::move(trusted), config.forwarded_header};
  std::vector<std::string> public_datasets;
  for (const config::DatasetConfig& dataset : config.datasets) {
    if (dataset.is_public) public_datasets.push_back(dataset.name);
  }
  admission.access = AccessPolicy::Make(config.tokens, public_datasets);
  admission.rate.per_second = config.requests_per_second;
  admission.rate.burst = config.request_burst > 0 ? config.request_burst : 2 * config.requests_per_second;

  std::unique_ptr<TlsContext> tls;
  if (!config.tls.certificate.empty()) {
    Result<std::unique_ptr<TlsContext>> opened = TlsContext::Open(config.tls.certificate, config.tls.key);
    if (!opened) return tl::unexpected(std::move(opened.error()));
    tls = *std::move(opened);
  }
  auto opened = std::make_unique<ClientLimits>(config, std::move(admission));
  opened->tls = std::move(tls);
  return opened;
}

asio::awaitable<void> WatchCertificate(TlsContext* tls) {
  asio::steady_timer timer(co_await asio::this_coro::executor);
  std::string problem;  // that the log has
  for (;;) {
    timer.expires_after(std::chrono::seconds(2));
    co_await timer.async_wait(asio::use_awaitable);
    const Result<bool> reloaded = tls->ReloadIfChanged();
    const std::string said = std::exchange(problem, reloaded ? std::string() : reloaded.error().message);
    if (!reloaded && problem != said) spdlog::warn("the certificate in use stays: {}", problem);
    if (reloaded && *reloaded) spdlog::info("new connections get the certificate that has just changed");
  }
}

}  // namespace terrace::server
