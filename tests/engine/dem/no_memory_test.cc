// An object that is returned while there is no memory is destroyed. A separate program, because it replaces operator
// new.
#include <gtest/gtest.h>

#include <cstdlib>
#include <new>
#include <optional>
#include <utility>

#include "engine/crs/geoid.h"
#include "engine/gdal/stamped_files.h"
#include "engine/image/image_pool.h"
#include "tests/engine/dem/dem_fixture.h"

namespace {
// The next allocation of this thread fails, and only this one, because otherwise GDAL could not close a file.
thread_local bool fails_next = false;
}  // namespace

// Not inlined: otherwise g++ 12 warns that std::free gets what operator new returned.
[[gnu::noinline]] void* operator new(std::size_t size) {
  void* const memory = std::exchange(fails_next, false) ? nullptr : std::malloc(size);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace terrace::dem {
namespace {

TEST(NoMemory, LetsOperationsGo) {
  const auto geoid = Geoid::OfCrs("EPSG:5773", {8, 46});
  ASSERT_TRUE(geoid);
  std::optional<Geoid::Reader> first, second;
  first.emplace(**geoid);
  second.emplace(**geoid);
  const double expected = second->At({8, 46});
  first.reset();  // the pool has memory for it, because the first one allocated it
  fails_next = true;
  second.reset();
  EXPECT_FALSE(fails_next) << "nothing was asked for";
  EXPECT_EQ((*geoid)->Undulation({8, 46}), expected);
}

TEST(NoMemory, LetsImagesGo) {
  const TempDir dir;
  RasterSpec spec;
  spec.type = "Byte";
  const std::string path = WriteRaster(dir, spec);
  auto image = ImageFile::Open(path);
  ASSERT_TRUE(image) << image.error().message;
  ImagePool pool(*std::move(image), StampedFiles({path}));
  {
    auto first = pool.Borrow(1), second = pool.Borrow(1);
    ASSERT_TRUE(first && second);
    fails_next = true;
  }
  EXPECT_FALSE(fails_next) << "nothing was asked for";
  EXPECT_TRUE(pool.Borrow(1));
}

}  // namespace
}  // namespace terrace::dem
