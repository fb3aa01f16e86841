// A client of HTTPS that believes any certificate and tells which one it saw, for tests.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace terrace::server {

struct TlsReply {
  bool secured = false;  // the handshake succeeded
  std::string version;   // "TLSv1.3"
  std::string protocol;  // by ALPN
  std::string subject;   // common name of the certificate
  std::string bytes;     // everything that came until the server closed, which `request` should ask for
};

// `highest`: TLS version as OpenSSL numbers them; 0: the newest. `ciphers` of TLS 1.2; empty: OpenSSL's own.
TlsReply FetchTls(std::uint16_t port, const std::string& request, int highest = 0, const std::string& ciphers = "");

// Sends the request and closes properly, with TLS's own goodbye, once `until` has returned.
void LeaveTls(std::uint16_t port, const std::string& request, const std::function<void()>& until);

// Writes a self-signed certificate for `name` and its key, PEM both.
void WriteCertificate(const std::string& name, const std::string& certificate_file, const std::string& key_file);

}  // namespace terrace::server
