// The server's certificate and the rules of TLS: 1.2 and 1.3, ciphers with forward secrecy, no renegotiation.
//
// Thread-safe. Connections keep the certificate that they began with.
#pragma once

#include <filesystem>
#include <memory>
#include <mutex>
#include <string>

#include "engine/core/result.h"
#include "server/asio/asio.h"

namespace boost::asio::ssl {
class context;
}

namespace terrace::server {

class TlsContext {
 public:
  // PEM files; the certificate's file may contain its chain. kInvalidArgument: a file cannot be read or is not PEM, or
  // key and certificate do not belong together.
  static Result<std::unique_ptr<TlsContext>> Open(std::filesystem::path certificate, std::filesystem::path key);

  std::shared_ptr<asio::ssl::context> Current() const;

  // Checks whether the files have changed, and uses the new certificate if it is valid; returns true then. On an error
  // the old certificate stays in use, and the next call tries the files again.
  Result<bool> ReloadIfChanged();

 private:
  TlsContext(std::filesystem::path certificate, std::filesystem::path key)
      : certificate_(std::move(certificate)), key_(std::move(key)) {}
  std::string Stamp() const;

  const std::filesystem::path certificate_, key_;
  mutable std::mutex mutex_;
  std::shared_ptr<asio::ssl::context> context_;
  std::string stamp_;  // of the files that are in use
};

}  // namespace terrace::server
