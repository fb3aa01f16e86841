// What the configuration says of the border between clients and the server.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace terrace::server {

// A token: either itself, or the SHA-256 of it in hexadecimal.
struct TokenOptions {
  std::string name;  // for the log
  std::string token, sha256;
  std::vector<std::string> datasets;  // empty: all
  double requests_per_second = 0;     // 0: as everybody
};

// Which header the proxies write. A proxy passes the other one on as the client sent it, so only one may count.
enum class ForwardedHeader { kXForwarded, kForwarded };

struct EdgeOptions {
  std::size_t max_connections = 1024;
  std::size_t max_connections_per_client = 0;  // 0: as many as there may be in all
  double requests_per_second = 0;              // of each token, and of each client without one; 0: any
  double request_burst = 0;                    // requests at once; 0: two seconds' worth
  std::size_t transfer_bytes = std::size_t{32} << 20;
  std::vector<TokenOptions> tokens;
  std::vector<std::string> public_datasets;  // seen without a token
  std::vector<std::string> cors_origins = {"*"};
  std::vector<std::string> trusted_proxies;  // addresses and ranges
  ForwardedHeader forwarded_header = ForwardedHeader::kXForwarded;
  std::filesystem::path tls_certificate, tls_key;  // empty: plain HTTP
};

}  // namespace terrace::server
