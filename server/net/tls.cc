#include "server/net/tls.h"

#include <fmt/format.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509err.h>
#include <sys/stat.h>

#include <boost/asio/ssl/context.hpp>
#include <boost/system/system_error.hpp>

namespace terrace::server {
namespace {

namespace ssl = asio::ssl;

// For TLS 1.2, which also has ciphers without forward secrecy or authenticated encryption; every suite of TLS 1.3 has
// both.
constexpr const char* kCiphers = "ECDHE+AESGCM:ECDHE+CHACHA20";

// ALPN: selects HTTP/1.1 for clients that prefer HTTP/2.
int ChooseProtocol(SSL*, const unsigned char** out, unsigned char* out_size, const unsigned char* in, unsigned in_size,
                   void*) {
  static constexpr unsigned char kOurs[] = "\x08http/1.1";
  unsigned char* chosen = nullptr;
  if (::SSL_select_next_proto(&chosen, out_size, kOurs, sizeof kOurs - 1, in, in_size) != OPENSSL_NPN_NEGOTIATED) {
    return SSL_TLSEXT_ERR_NOACK;
  }
  *out = chosen;
  return SSL_TLSEXT_ERR_OK;
}

// Without it OpenSSL asks for the passphrase of an encrypted key on the terminal, and the thread waits for the answer.
int NoPassphrase(char*, int, int, void*) { return 0; }

Result<std::shared_ptr<ssl::context>> Load(const std::filesystem::path& certificate, const std::filesystem::path& key) {
  const std::filesystem::path* file = &certificate;
  const auto mismatch = [&] {
    return MakeError(ErrorCode::kInvalidArgument, "{}: is not the key of the certificate in {}", key.string(),
                     certificate.string());
  };
  try {
    auto context = std::make_shared<ssl::context>(ssl::context::tls_server);
    SSL_CTX* const native = context->native_handle();
    ::SSL_CTX_set_min_proto_version(native, TLS1_2_VERSION);
    ::SSL_CTX_set_options(native, SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION | SSL_OP_CIPHER_SERVER_PREFERENCE |
                                      SSL_OP_IGNORE_UNEXPECTED_EOF);
    ::SSL_CTX_set_mode(native, SSL_MODE_RELEASE_BUFFERS);
    ::SSL_CTX_set_cipher_list(native, kCiphers);
    ::SSL_CTX_set_alpn_select_cb(native, ChooseProtocol, nullptr);
    ::SSL_CTX_set_default_passwd_cb(native, NoPassphrase);
    context->use_certificate_chain_file(certificate.string());
    file = &key;
    context->use_private_key_file(key.string(), ssl::context::pem);  // throws if a key of another type is required
    if (::SSL_CTX_check_private_key(native) != 1) return mismatch();
    return context;
  } catch (const boost::system::system_error& error) {
    if (ERR_GET_REASON(static_cast<unsigned long>(error.code().value())) == X509_R_KEY_VALUES_MISMATCH) {
      return mismatch();
    }
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: cannot be used for TLS ({}); it must be a readable PEM file, the key without a passphrase",
                     file->string(), error.code().message());
  }
}

std::string StampOf(const std::filesystem::path& file) {
  struct stat status {};
  if (::stat(file.c_str(), &status) != 0) return "missing";
  // Permissions and owner, which decide whether the file can be read, change only the time of the status.
  return fmt::format("{}:{}:{}:{}.{}:{}.{}", status.st_dev, status.st_ino, status.st_size, status.st_mtim.tv_sec,
                     status.st_mtim.tv_nsec, status.st_ctim.tv_sec, status.st_ctim.tv_nsec);
}

}  // namespace

Result<std::unique_ptr<TlsContext>> TlsContext::Open(std::filesystem::path certificate, std::filesystem::path key) {
  std::unique_ptr<TlsContext> tls(new TlsContext(std::move(certificate), std::move(key)));
  tls->stamp_ = tls->Stamp();
  Result<std::shared_ptr<ssl::context>> context = Load(tls->certificate_, tls->key_);
  if (!context) return tl::unexpected(context.error());
  tls->context_ = *std::move(context);
  return tls;
}

std::string TlsContext::Stamp() const { return StampOf(certificate_) + " " + StampOf(key_); }

std::shared_ptr<ssl::context> TlsContext::Current() const {
  const std::lock_guard lock(mutex_);
  return context_;
}

Result<bool> TlsContext::ReloadIfChanged() {
  const std::string stamp = Stamp();
  {
    const std::lock_guard lock(mutex_);
    if (stamp == stamp_) return false;
  }
  Result<std::shared_ptr<ssl::context>> context = Load(certificate_, key_);
  if (!context) return tl::unexpected(context.error());
  const std::lock_guard lock(mutex_);
  context_ = *std::move(context);
  stamp_ = stamp;
  return true;
}

}  // namespace terrace::server
