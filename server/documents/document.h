// Documents in two forms. Prepared ones have both codings and their ETags: layer.json, /datasets, the viewer's files.
// Documents that depend on a request's parameters are made on a worker, because even short ones may take longer than a
// cached tile (a subtree needs the heights of hundreds of tiles), once for all clients that wait for it, and cached for
// a while.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <variant>

#include "engine/core/result.h"
#include "server/api/request_context.h"
#include "server/asio/asio.h"
#include "server/http/application.h"
#include "server/http/request.h"
#include "server/http/response.h"
#include "server/jobs/single_flight.h"
#include "server/tiles/catalog.h"
#include "tiler/store/byte_cache.h"

namespace terrace::server {

struct Document {
  std::string_view content_type;  // a literal
  Body identity, gzip;            // gzip is null if it would not be smaller
  std::string identity_etag, gzip_etag;

  // `gzipped`: the same bytes, compressed beforehand.
  static Document Make(std::string bytes, std::string_view content_type,
                       std::optional<std::string> gzipped = std::nullopt);
};

// Returns the document in the coding that the request prefers; 304 if the client already has it.
Response Serve(const Document& document, const Request& request, std::string_view cache_control);

struct DocumentText {
  DocumentText() = default;
  DocumentText(std::string text) : bytes(std::move(text)) {}  // NOLINT(google-explicit-constructor)

  std::string bytes;
  // Whether it stays the same. False: something could not be read. The document is then right but not as good as it can
  // be; it is not cached, and clients ask for it again.
  bool is_final = true;
};

struct DocumentPlan {
  // Called on any thread. Refers only to the catalog and to its own captures. Long writers check the stop token; the
  // result is discarded after a stop.
  using Write = std::function<DocumentText(const std::stop_token&)>;

  std::string key;                 // equal only for equal documents of one catalog; contains no token
  std::string_view content_type;   // a literal
  std::string_view cache_control;  // outlives the request
  bool depends_on_token = false;   // as in Response
  Write write;
  // Of the dataset, if the document depends on nothing else: clients that have it are answered before it is written.
  // Nothing: the ETag is a hash of the bytes.
  std::optional<std::uint64_t> generation;
};

// The result of a handler of documents: a reply, or a plan to make one.
using DocumentAnswer = std::variant<Response, DocumentPlan>;

// A document in one coding.
struct RenderedDocument {
  Body body;
  tiler::Coding coding = tiler::Coding::kIdentity;
  std::string etag;
  bool is_final = true;  // as in DocumentText
};
inline std::size_t BytesOf(const RenderedDocument& made) { return made.body->size() + made.etag.size(); }

// `coding`: kGzip becomes identity if gzip does not make the text smaller. Bytes and ETag are equal to those of a
// Document with the same text. kCancelled: a stop was requested.
Result<RenderedDocument> MakeDocument(const DocumentPlan::Write& write, tiler::Coding coding,
                                      const std::stop_token& stop);

// Like Serve for a Document.
Response Serve(const RenderedDocument& made, const DocumentPlan& plan, const Request& request);

// Documents that are being made, of all catalogs.
using DocumentFlights = SingleFlight<std::string, std::shared_ptr<const RenderedDocument>>;

// Thread-safe.
class DocumentMaker {
 public:
  // Size of the cache. The least recently used documents are evicted first.
  static constexpr std::size_t kKeptBytes = std::size_t{8} << 20;

  // `flights` must outlive this object. All plans refer to `catalog`.
  DocumentMaker(CatalogPtr catalog, DocumentFlights& flights);

  // Returns cached documents at once. This object and `context` must outlive the answer.
  Answer Make(DocumentAnswer described, const RequestContext& context) const;

 private:
  struct Key {
    std::string text;
    tiler::Coding coding = tiler::Coding::kIdentity;
    std::uint64_t generation = 0;  // ByteCache needs it; always 0, because all documents belong to one catalog

    friend bool operator==(const Key&, const Key&) = default;
  };
  struct KeyHash {
    std::size_t operator()(const Key& key) const noexcept {
      return std::hash<std::string>{}(key.text) ^ static_cast<std::size_t>(key.coding);
    }
  };

  asio::awaitable<Response> MakeOnWorker(DocumentPlan plan, tiler::Coding coding, const RequestContext& context) const;

  const CatalogPtr catalog_;
  DocumentFlights& flights_;
  mutable tiler::ByteCache<Key, KeyHash, RenderedDocument> kept_{kKeptBytes};
};

}  // namespace terrace::server
