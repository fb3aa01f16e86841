// An HTTPS client for tests that accepts any certificate and reports it.
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
  std::string bytes;     // everything until the server closed; `request` must ask for that
};

// `highest`: OpenSSL's number of the TLS version; 0: the newest. `ciphers`: those of TLS 1.2; empty: OpenSSL's default.
TlsReply FetchTls(std::uint16_t port, const std::string& request, int highest = 0, const std::string& ciphers = "");

// Sends the request, and closes with TLS's close_notify when `until` has returned.
void LeaveTls(std::uint16_t port, const std::string& request, const std::function<void()>& until);

// Writes a self-signed certificate for `name` and its key, PEM both. `passphrase`: encrypts the key; empty: it is
// plain.
void WriteCertificate(const std::string& name, const std::string& certificate_file, const std::string& key_file,
                      const std::string& passphrase = "");

}  // namespace terrace::server
