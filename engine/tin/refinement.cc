#include "engine/tin/refinement.h"

#include <xxhash.h>

#include <algorithm>
#include <cstring>
#include <type_traits>
#include <utility>

#include "engine/core/bytes.h"
#include "engine/core/check.h"
#include "engine/tin/live_triangles.h"

namespace terrace::tin {
namespace {

using Index = InsertionRecord::Index;

constexpr std::string_view kMagic = "terrace refinement 1\n";
constexpr std::uint32_t kMaxSide = 1U << 16;  // of SamplePosition

template <typename T>
void PutArray(ByteWriter& writer, const std::vector<T>& values) {
  static_assert(std::is_trivially_copyable_v<T>);
  writer.Put(static_cast<std::uint32_t>(values.size()));
  writer.PutBytes({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)});
}

template <typename T>
bool GetArray(ByteReader& reader, std::vector<T>& values) {
  const std::size_t count = reader.Get<std::uint32_t>();
  const std::string_view raw = reader.GetBytes(count * sizeof(T));
  if (!reader.ok()) return false;
  values.resize(count);
  if (count > 0) std::memcpy(values.data(), raw.data(), raw.size());
  return true;
}

// Checks that rings consist of earlier vertices and have the stated sizes, and that every insertion removes two
// triangles fewer than it makes, one fewer on the border.
bool IsSoundRecord(const InsertionRecord& record, std::size_t insertions) {
  if (record.sizes.size() != insertions || record.removed.size() < 2) return false;
  std::vector<std::size_t> removed(insertions, 0);
  for (const Index by : record.removed) {
    if (by == InsertionRecord::kNever) continue;
    if (by >= insertions) return false;
    ++removed[by];
  }
  std::size_t ring = 0, made = 2;
  for (std::size_t i = 0; i < insertions; ++i) {
    const bool is_open = (record.sizes[i] & InsertionRecord::kOpen) != 0;
    const std::size_t count = record.sizes[i] & static_cast<Index>(~InsertionRecord::kOpen);
    const std::size_t vertices = count + (is_open ? 1 : 0);
    if (count == 0 || count != removed[i] + (is_open ? 1 : 2)) return false;
    if (vertices > record.rings.size() - ring || count > record.removed.size() - made) return false;
    for (std::size_t k = ring; k < ring + vertices; ++k) {
      if (record.rings[k] >= 4 + i) return false;
    }
    for (std::size_t k = made; k < made + count; ++k) {
      if (record.removed[k] <= i) return false;  // before it was made
    }
    ring += vertices;
    made += count;
  }
  return ring == record.rings.size() && made == record.removed.size();
}

}  // namespace

Refinement::Refinement(int width, int height, std::vector<SamplePosition> inserted, std::vector<float> errors_before,
                       InsertionRecord record)
    : width_(width),
      height_(height),
      inserted_(std::move(inserted)),
      errors_before_(std::move(errors_before)),
      record_(std::move(record)) {
  TERRACE_CHECK(inserted_.size() == errors_before_.size() && inserted_.size() == record_.sizes.size());
  TERRACE_CHECK(vertex_count() <= kMaxVertices);
}

std::size_t Refinement::PointsAt(double max_error) const {
  const auto met = [=](float error) { return static_cast<double>(error) <= max_error; };
  return 4 + static_cast<std::size_t>(std::find_if(errors_before_.begin(), errors_before_.end(), met) -
                                      errors_before_.begin());
}

TinMesh Refinement::MeshOf(std::size_t points) const {
  TERRACE_CHECK(points >= 4 && points <= vertex_count());
  const auto east = static_cast<std::uint16_t>(width_ - 1), north = static_cast<std::uint16_t>(height_ - 1);
  TinMesh mesh;
  mesh.vertices.reserve(points);
  mesh.vertices = {{0, 0}, {east, 0}, {east, north}, {0, north}};
  mesh.vertices.insert(mesh.vertices.end(), inserted_.begin(),
                       inserted_.begin() + static_cast<std::ptrdiff_t>(points - 4));
  mesh.triangles = LiveTriangles(record_, points - 4);
  return mesh;
}

std::size_t Refinement::bytes() const {
  const std::size_t indices = record_.sizes.capacity() + record_.rings.capacity() + record_.removed.capacity();
  return sizeof(Refinement) + inserted_.capacity() * sizeof(SamplePosition) +
         errors_before_.capacity() * sizeof(float) + indices * sizeof(Index);
}

// Format: kMagic, width, height, bytes of an index, then five arrays, each preceded by its length, then the hash of all
// that. All numbers have 32 bits, except the elements of arrays.
std::string Refinement::Serialize() const {
  ByteWriter writer;
  writer.Reserve(bytes() + 64);
  writer.PutBytes(kMagic);
  writer.Put(static_cast<std::uint32_t>(width_));
  writer.Put(static_cast<std::uint32_t>(height_));
  writer.Put(std::uint32_t{sizeof(Index)});
  PutArray(writer, inserted_);
  PutArray(writer, errors_before_);
  PutArray(writer, record_.sizes);
  PutArray(writer, record_.rings);
  PutArray(writer, record_.removed);
  std::string bytes = writer.Take();
  const std::uint64_t hash = XXH3_64bits(bytes.data(), bytes.size());
  bytes.append(reinterpret_cast<const char*>(&hash), sizeof(hash));
  return bytes;
}

Result<Refinement> Refinement::Parse(std::string_view bytes) {
  const auto damaged = [] { return MakeError(ErrorCode::kInvalidArgument, "not a refinement, or a damaged one"); };
  std::uint64_t hash = 0;
  if (bytes.size() < kMagic.size() + sizeof(hash)) return damaged();
  const std::string_view content = bytes.substr(0, bytes.size() - sizeof(hash));
  std::memcpy(&hash, bytes.data() + content.size(), sizeof(hash));
  if (hash != XXH3_64bits(content.data(), content.size())) return damaged();

  ByteReader reader(content);
  Refinement refinement;
  if (reader.GetBytes(kMagic.size()) != kMagic) return damaged();
  const auto width = reader.Get<std::uint32_t>(), height = reader.Get<std::uint32_t>();
  if (width < 2 || height < 2 || width > kMaxSide || height > kMaxSide) return damaged();
  refinement.width_ = static_cast<int>(width);
  refinement.height_ = static_cast<int>(height);
  if (reader.Get<std::uint32_t>() != sizeof(Index)) return damaged();
  InsertionRecord& record = refinement.record_;
  const bool whole = GetArray(reader, refinement.inserted_) && GetArray(reader, refinement.errors_before_) &&
                     GetArray(reader, record.sizes) && GetArray(reader, record.rings) &&
                     GetArray(reader, record.removed) && reader.remaining() == 0;
  if (!whole || !refinement.IsSound()) return damaged();
  return refinement;
}

// The conditions that MeshOf relies on.
bool Refinement::IsSound() const {
  for (const SamplePosition sample : inserted_) {
    if (sample.x >= width_ || sample.y >= height_) return false;
  }
  return vertex_count() <= kMaxVertices && inserted_.size() == errors_before_.size() &&
         IsSoundRecord(record_, inserted_.size());
}

}  // namespace terrace::tin
