// Documents that depend on a request's parameters: made on a worker, since even short ones may take longer than a
// cached tile (a subtree looks at the heights of hundreds of tiles), and kept for a while.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <string_view>
#include <variant>

#include "engine/core/result.h"
#include "server/api/call.h"
#include "server/api/handler_options.h"
#include "server/asio.h"
#include "server/http/application.h"
#include "server/http/request.h"
#include "server/http/response.h"
#include "server/tiles/catalog.h"
#include "server/tiles/tile_service.h"
#include "tiler/store/byte_cache.h"

namespace terrace::server {

struct DocumentPlan {
  // On any thread; refers to nothing but the catalog and what it holds itself. What is long asks the stop token
  // as it writes; what it gives after a stop is of no use.
  using Write = std::function<std::string(const std::stop_token&)>;

  std::string key;                 // of one catalog's documents, equal for equal ones alone; holds no token
  std::string_view content_type;   // a literal
  std::string_view cache_control;  // outlives the request
  bool for_grant = false;          // as in Response
  Write write;
};

// What a handler of documents says: the reply, or what it takes to make it.
using Described = std::variant<Response, DocumentPlan>;

// In the one coding that was asked for.
struct MadeDocument {
  Body body;
  tiler::Coding coding = tiler::Coding::kIdentity;
  std::string etag;
};
inline std::size_t BytesOf(const MadeDocument& made) { return made.body->size() + made.etag.size(); }

// `coding`: kGzip gives identity where that is not larger. Bytes and ETag are those of a Document of the same text.
// kCancelled: a stop was requested.
Result<MadeDocument> MakeDocument(const DocumentPlan::Write& write, tiler::Coding coding, const std::stop_token& stop);

// As Serve of a Document.
Response Serve(const MadeDocument& made, const DocumentPlan& plan, const Request& request);

// Thread-safe.
class DocumentMaker {
 public:
  // Of those kept, least recently asked for leave first.
  static constexpr std::size_t kKeptBytes = std::size_t{8} << 20;

  // `workers` must outlive this. Plans are about `catalog`.
  DocumentMaker(CatalogPtr catalog, TileService& workers, HandlerOptions options);

  // At once what was kept. This and `call` outlive the answer.
  Answer Make(Described described, const Call& call) const;

 private:
  struct Key {
    std::string text;
    tiler::Coding coding = tiler::Coding::kIdentity;
    std::uint64_t generation = 0;  // of one catalog all are

    friend bool operator==(const Key&, const Key&) = default;
  };
  struct KeyHash {
    std::size_t operator()(const Key& key) const noexcept {
      return std::hash<std::string>{}(key.text) ^ static_cast<std::size_t>(key.coding);
    }
  };

  asio::awaitable<Response> MakeAside(DocumentPlan plan, tiler::Coding coding, const Call& call) const;

  const CatalogPtr catalog_;
  TileService& workers_;
  const HandlerOptions options_;
  mutable tiler::ByteCache<Key, KeyHash, MadeDocument> kept_{kKeptBytes};
};

}  // namespace terrace::server
