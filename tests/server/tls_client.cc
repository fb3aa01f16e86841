#include "tests/server/tls_client.h"

#include <openssl/bio.h>
#include <openssl/ec.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>
#include <sys/socket.h>

#include <cstdio>
#include <memory>

namespace terrace::server {

TlsReply FetchTls(std::uint16_t port, const std::string& request, int highest, const std::string& ciphers) {
  TlsReply reply;
  const std::unique_ptr<SSL_CTX, void (*)(SSL_CTX*)> context(::SSL_CTX_new(::TLS_client_method()), ::SSL_CTX_free);
  ::SSL_CTX_set_security_level(context.get(), 0);
  ::SSL_CTX_set_min_proto_version(context.get(), TLS1_VERSION);
  if (highest != 0) ::SSL_CTX_set_max_proto_version(context.get(), highest);
  if (!ciphers.empty()) ::SSL_CTX_set_cipher_list(context.get(), ciphers.c_str());
  constexpr unsigned char kProtocols[] = "\x02h2\x08http/1.1";
  ::SSL_CTX_set_alpn_protos(context.get(), kProtocols, sizeof kProtocols - 1);
  const std::unique_ptr<BIO, void (*)(BIO*)> bio(::BIO_new_ssl_connect(context.get()), ::BIO_free_all);
  ::BIO_set_conn_hostname(bio.get(), ("127.0.0.1:" + std::to_string(port)).c_str());
  if (::BIO_do_connect(bio.get()) != 1 || BIO_do_handshake(bio.get()) != 1) return reply;
  SSL* ssl = nullptr;
  BIO_get_ssl(bio.get(), &ssl);
  reply.secured = true;
  reply.version = ::SSL_get_version(ssl);
  const unsigned char* protocol = nullptr;
  unsigned size = 0;
  ::SSL_get0_alpn_selected(ssl, &protocol, &size);
  reply.protocol.assign(reinterpret_cast<const char*>(protocol), size);
  const std::unique_ptr<X509, void (*)(X509*)> certificate(::SSL_get1_peer_certificate(ssl), ::X509_free);
  char name[256] = {};
  ::X509_NAME_get_text_by_NID(::X509_get_subject_name(certificate.get()), NID_commonName, name, sizeof name);
  reply.subject = name;
  ::BIO_write(bio.get(), request.data(), static_cast<int>(request.size()));
  char bytes[16384];
  for (int got; (got = ::BIO_read(bio.get(), bytes, sizeof bytes)) > 0;) reply.bytes.append(bytes, got);
  return reply;
}

void LeaveTls(std::uint16_t port, const std::string& request, const std::function<void()>& until) {
  const std::unique_ptr<SSL_CTX, void (*)(SSL_CTX*)> context(::SSL_CTX_new(::TLS_client_method()), ::SSL_CTX_free);
  const std::unique_ptr<BIO, void (*)(BIO*)> bio(::BIO_new_ssl_connect(context.get()), ::BIO_free_all);
  ::BIO_set_conn_hostname(bio.get(), ("127.0.0.1:" + std::to_string(port)).c_str());
  if (::BIO_do_connect(bio.get()) != 1 || BIO_do_handshake(bio.get()) != 1) return;
  ::BIO_write(bio.get(), request.data(), static_cast<int>(request.size()));
  until();
  SSL* ssl = nullptr;
  BIO_get_ssl(bio.get(), &ssl);
  ::SSL_shutdown(ssl);
  ::shutdown(::SSL_get_fd(ssl), SHUT_RDWR);
}

void WriteCertificate(const std::string& name, const std::string& certificate_file, const std::string& key_file,
                      const std::string& passphrase) {
  const std::unique_ptr<EVP_PKEY, void (*)(EVP_PKEY*)> key(EVP_EC_gen("P-256"), ::EVP_PKEY_free);
  const std::unique_ptr<X509, void (*)(X509*)> certificate(::X509_new(), ::X509_free);
  ::ASN1_INTEGER_set(::X509_get_serialNumber(certificate.get()), 1);
  ::X509_gmtime_adj(::X509_getm_notBefore(certificate.get()), 0);
  ::X509_gmtime_adj(::X509_getm_notAfter(certificate.get()), 3600);
  ::X509_set_pubkey(certificate.get(), key.get());
  X509_NAME* const subject = ::X509_get_subject_name(certificate.get());
  ::X509_NAME_add_entry_by_txt(subject, "CN", MBSTRING_ASC, reinterpret_cast<const unsigned char*>(name.c_str()), -1,
                               -1, 0);
  ::X509_set_issuer_name(certificate.get(), subject);
  ::X509_sign(certificate.get(), key.get(), ::EVP_sha256());
  const auto write = [](const std::string& file, auto&& put) {
    const std::string fresh = file + ".new";
    std::FILE* const out = std::fopen(fresh.c_str(), "w");
    put(out);
    std::fclose(out);
    std::rename(fresh.c_str(), file.c_str());
  };
  write(key_file, [&](std::FILE* out) {
    ::PEM_write_PrivateKey(out, key.get(), passphrase.empty() ? nullptr : ::EVP_aes_256_cbc(),
                           reinterpret_cast<const unsigned char*>(passphrase.data()),
                           static_cast<int>(passphrase.size()), nullptr, nullptr);
  });
  write(certificate_file, [&](std::FILE* out) { ::PEM_write_X509(out, certificate.get()); });
}

}  // namespace terrace::server
