#include "proto/gltf/texture.h"

// clang-format off
#include <cstdio>  // jpeglib.h needs FILE
#include <jpeglib.h>
// clang-format on
#include <webp/encode.h>

#include <csetjmp>
#include <cstddef>
#include <cstdlib>
#include <memory>

#include "engine/core/check.h"

namespace terrace::proto {
namespace {

// On errors, leaves libjpeg by longjmp; the default handler would end the process.
struct JpegErrors {
  jpeg_error_mgr base;  // first, because libjpeg sees only this member
  std::jmp_buf leave;
};

[[noreturn]] void LeaveJpeg(j_common_ptr jpeg) { std::longjmp(reinterpret_cast<JpegErrors*>(jpeg->err)->leave, 1); }

// Uses no objects with destructors, which longjmp would skip. Returns false on errors. `bytes` is allocated by malloc.
bool CompressJpeg(const std::uint8_t* rgb, int width, int height, int quality, unsigned char** bytes,
                  unsigned long* size) {
  jpeg_compress_struct jpeg;
  JpegErrors errors;
  jpeg.err = jpeg_std_error(&errors.base);
  errors.base.error_exit = LeaveJpeg;
  if (setjmp(errors.leave) != 0) {
    jpeg_destroy_compress(&jpeg);
    *bytes = nullptr;  // after an error during growth, the pointer may be dangling
    return false;
  }
  jpeg_create_compress(&jpeg);
  jpeg_mem_dest(&jpeg, bytes, size);
  jpeg.image_width = static_cast<JDIMENSION>(width);
  jpeg.image_height = static_cast<JDIMENSION>(height);
  jpeg.input_components = 3;
  jpeg.in_color_space = JCS_RGB;
  jpeg_set_defaults(&jpeg);
  jpeg_set_quality(&jpeg, quality, /*force_baseline=*/TRUE);
  jpeg.optimize_coding = TRUE;
  jpeg.dct_method = JDCT_ISLOW;  // whole numbers: the same on every processor
  jpeg_start_compress(&jpeg, TRUE);
  while (jpeg.next_scanline < jpeg.image_height) {
    const std::size_t offset = std::size_t{3} * jpeg.next_scanline * jpeg.image_width;
    JSAMPROW row = const_cast<JSAMPROW>(rgb + offset);  // libjpeg does not write to it
    jpeg_write_scanlines(&jpeg, &row, 1);
  }
  jpeg_finish_compress(&jpeg);
  jpeg_destroy_compress(&jpeg);
  return true;
}

Result<std::string> EncodeJpeg(const std::uint8_t* rgb, int width, int height, int quality) {
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  const bool is_done = CompressJpeg(rgb, width, height, quality, &bytes, &size);
  const std::unique_ptr<unsigned char, void (*)(void*)> owner(bytes, std::free);
  if (!is_done) return MakeError(ErrorCode::kInternal, "libjpeg cannot encode {} x {} pixels", width, height);
  return std::string(reinterpret_cast<const char*>(bytes), size);
}

Result<std::string> EncodeWebp(const std::uint8_t* rgb, int width, int height, int quality) {
  std::uint8_t* bytes = nullptr;
  const std::size_t size = WebPEncodeRGB(rgb, width, height, 3 * width, static_cast<float>(quality), &bytes);
  const std::unique_ptr<std::uint8_t, void (*)(void*)> owner(bytes, WebPFree);
  if (size == 0) return MakeError(ErrorCode::kInternal, "libwebp cannot encode {} x {} pixels", width, height);
  return std::string(reinterpret_cast<const char*>(bytes), size);
}

}  // namespace

std::string_view MediaTypeOf(TextureFormat format) {
  TERRACE_CHECK(format != TextureFormat::kNone);
  return format == TextureFormat::kJpeg ? "image/jpeg" : "image/webp";
}

Result<std::string> EncodePicture(std::span<const std::uint8_t> rgb, int width, int height, TextureFormat format,
                                  int quality) {
  constexpr int kMaxSide = WEBP_MAX_DIMENSION;
  TERRACE_CHECK(width >= 1 && height >= 1 && width <= kMaxSide && height <= kMaxSide);
  TERRACE_CHECK(rgb.size() == std::size_t{3} * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  TERRACE_CHECK(format != TextureFormat::kNone && quality >= 1 && quality <= 100);
  return format == TextureFormat::kJpeg ? EncodeJpeg(rgb.data(), width, height, quality)
                                        : EncodeWebp(rgb.data(), width, height, quality);
}

}  // namespace terrace::proto
