#include "server/edge.h"

#include <spdlog/spdlog.h>

#include <boost/asio/steady_timer.hpp>
#include <boost/asio/this_coro.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <utility>

namespace terrace::server {

Edge::Edge(const EdgeOptions& options, GateOptions gate_options)
    : connections(options.max_connections, options.max_connections_per_client),
      transfers(options.transfer_bytes),
      gate(std::move(gate_options)),
      cors(options.cors_origins) {}

Result<std::unique_ptr<Edge>> Edge::Open(const EdgeOptions& options) {
  GateOptions gate;
  Result<AddressRanges> trusted = AddressRanges::Parse(options.trusted_proxies);
  if (!trusted) return tl::unexpected(std::move(trusted.error()));
  gate.proxies = {*std::move(trusted), options.forwarded_header};
  Result<AccessPolicy> access = AccessPolicy::Make(options.tokens, options.public_datasets);
  if (!access) return tl::unexpected(std::move(access.error()));
  gate.access = *std::move(access);
  gate.rate.per_second = options.requests_per_second;
  gate.rate.burst = options.request_burst > 0 ? options.request_burst : 2 * options.requests_per_second;

  std::unique_ptr<TlsContext> tls;
  if (!options.tls_certificate.empty()) {
    Result<std::unique_ptr<TlsContext>> opened = TlsContext::Open(options.tls_certificate, options.tls_key);
    if (!opened) return tl::unexpected(std::move(opened.error()));
    tls = *std::move(opened);
  }
  auto edge = std::make_unique<Edge>(options, std::move(gate));
  edge->tls = std::move(tls);
  return edge;
}

asio::awaitable<void> WatchCertificate(TlsContext* tls) {
  asio::steady_timer timer(co_await asio::this_coro::executor);
  for (;;) {
    timer.expires_after(std::chrono::seconds(2));
    co_await timer.async_wait(asio::use_awaitable);
    const Result<bool> reloaded = tls->ReloadIfChanged();
    if (!reloaded) {
      spdlog::warn("the certificate in use stays: {}", reloaded.error().message);
    } else if (*reloaded) {
      spdlog::info("new connections get the certificate that has just changed");
    }
  }
}

}  // namespace terrace::server
