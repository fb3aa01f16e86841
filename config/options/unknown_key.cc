
#include <fmt/format.h>

#include <array>
#include <vector>

#include "config/options/option_table.h"

namespace terrace::config {
namespace {

// A kind of object in the file.
struct Kind {
  std::string_view place;  // "in an object of ..."
  std::vector<KnownName> keys;
};

const std::array<Kind, 9>& Kinds() {
  static const std::array<Kind, 9> kinds = {
      {{"at the top of the file", KnownNames(ServerOptionTable())},
       {"in an object of \"datasets\"", KnownNames(DatasetOptionTable())},
       {"in an object of a dataset's \"sources\"", KnownNames(SourceOptionTable())},
       {"in a dataset's \"imagery\"", KnownNames(ImageryOptionTable())},
       {"in \"disk_cache\"", KnownNames(DiskCacheOptionTable())},
       {"in \"shared_cache\"", KnownNames(SharedCacheOptionTable())},
       {"in an object of \"tokens\"", KnownNames(TokenOptionTable())},
       {"in a dataset's \"water\"", {{"mask"}, {"sea_level"}}},
       {"in \"tls\"", {{"certificate"}, {"key"}}}}};
  return kinds;
}

}  // namespace

// The order: kinds that have the key itself, then similar keys of this object, then similar keys of the other kinds.
std::string ExplainKey(std::string_view key, std::span<const KnownName> known) {
  std::string name;
  std::vector<std::string> places;
  for (const Kind& kind : Kinds()) {
    for (const KnownName& other : kind.keys) {
      if (!IsSameName(other.name, key)) continue;
      name = other.name;
      places.emplace_back(kind.place);
    }
  }
  const std::vector<std::string_view> here = NearestNames(key, known);
  const bool is_here = !here.empty() && IsSameName(here.front(), key);  // apart from a dash or a capital letter
  if (!places.empty() && !is_here) {
    return fmt::format("is no key of this object; \"{}\" belongs {}", name, Alternatives(places));
  }
  if (!here.empty()) return "unknown key" + DidYouMean(Quoted(here));
  std::vector<std::string> elsewhere;
  for (const Kind& kind : Kinds()) {
    const std::vector<std::string> names = Quoted(NearestNames(key, kind.keys));
    if (!names.empty()) elsewhere.push_back(fmt::format("{} {}", Alternatives(names), kind.place));
  }
  return elsewhere.empty() ? "" : "is no key of this object" + DidYouMean(elsewhere);
}

}  // namespace terrace::config
