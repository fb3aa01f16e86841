#include "tiler/tile/build_id.h"

#include <elf.h>
#include <fmt/format.h>
#include <link.h>
#include <sys/stat.h>
#include <xxhash.h>

#include <algorithm>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

namespace terrace::tiler {
namespace {

// The notes of a segment: name size, description size and type, 32 bits each; name; description; both padded to four.
std::string_view BuildIdIn(std::string_view notes) {
  const auto padded = [](std::size_t size) { return (size + 3) & ~std::size_t{3}; };
  ElfW(Nhdr) head;
  while (notes.size() >= sizeof(head)) {
    std::memcpy(&head, notes.data(), sizeof(head));
    const std::size_t name = padded(head.n_namesz), description = padded(head.n_descsz);
    if (notes.size() < sizeof(head) + name + description) break;
    if (head.n_type == NT_GNU_BUILD_ID && notes.substr(sizeof(head), 4) == std::string_view("GNU", 4)) {
      return notes.substr(sizeof(head) + name, head.n_descsz);
    }
    notes.remove_prefix(sizeof(head) + name + description);
  }
  return {};
}

std::string FileIdentity(const char* path) {
  struct stat status {};
  if (stat(*path != '\0' ? path : "/proc/self/exe", &status) != 0) return path;
  return fmt::format("{} {} {}.{}", path, status.st_size, status.st_mtim.tv_sec, status.st_mtim.tv_nsec);
}

int Collect(dl_phdr_info* object, std::size_t, void* to) {
  const std::string_view name = object->dlpi_name;
  if (name.starts_with("linux-vdso")) return 0;  // the kernel's vDSO, which does not affect tiles
  std::string_view id;
  for (int i = 0; i < object->dlpi_phnum && id.empty(); ++i) {
    const ElfW(Phdr)& segment = object->dlpi_phdr[i];
    if (segment.p_type != PT_NOTE) continue;
    // Mapped read-only, as long as the library is loaded.
    id = BuildIdIn({reinterpret_cast<const char*>(object->dlpi_addr + segment.p_vaddr), segment.p_memsz});
  }
  static_cast<std::vector<std::string>*>(to)->push_back(id.empty() ? FileIdentity(object->dlpi_name) : std::string(id));
  return 0;
}

}  // namespace

std::uint64_t BuildId() {
  static const std::uint64_t hash = [] {
    std::vector<std::string> objects;
    dl_iterate_phdr(Collect, &objects);
    std::sort(objects.begin(), objects.end());
    std::string all;
    for (const std::string& object : objects) all += object + '\n';
    return XXH3_64bits(all.data(), all.size());
  }();
  return hash;
}

}  // namespace terrace::tiler
