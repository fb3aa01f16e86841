#include "tiler/tile_texture.h"

#include <optional>
#include <utility>

namespace terrace::tiler {

Result<void> AddTexture(const ImageryRules& imagery, const TileRequest& request, proto::GlbOptions& options,
                        const std::stop_token& stop) {
  if (!imagery.image || request.texture == proto::TextureFormat::kNone) return {};
  const int side = imagery.image->SideOf(request.key.level, imagery.side);
  const Result<std::optional<dem::TilePicture>> picture = imagery.image->Read(request.key, side, stop);
  if (!picture) return tl::unexpected(picture.error());
  if (!*picture) return {};
  Result<std::string> bytes = proto::EncodePicture((*picture)->rgb, side, side, request.texture, imagery.quality);
  if (!bytes) return tl::unexpected(std::move(bytes).error());
  options.texture = proto::GlbTexture{*std::move(bytes), proto::MediaTypeOf(request.texture)};
  // Clients split credits at semicolons (CesiumJS, cesium-native).
  if (!options.copyright.empty() && !imagery.attribution.empty()) options.copyright += "; ";
  options.copyright += imagery.attribution;
  return {};
}

}  // namespace terrace::tiler
