#include "smartsurf/run/cli/RenderOptions.h"

#include <CLI/CLI.hpp>
#include <algorithm>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::run {
namespace {

const std::vector<std::string> kCameras = {"top", "iso", "side"};
const std::vector<std::string> kPalettes(view::kPaletteNames.begin(), view::kPaletteNames.end());

std::size_t index_of(const std::vector<std::string>& names, const std::string& name) {
  return static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
}

constexpr int kMinEdge = 16, kMaxEdge = 8192;  // pixels

common::PixelSize parse_pixel_size(const std::string& text) {
  const std::optional<common::PixelSize> size = common::parse_size(text);
  if (!size || std::min(size->width, size->height) < kMinEdge ||
      std::max(size->width, size->height) > kMaxEdge)
    throw scene::InputError("--picture-size " + text + ": must have the form 1600x1000, each edge from " +
                            std::to_string(kMinEdge) + " to " + std::to_string(kMaxEdge) + " pixels");
  return *size;
}

}  // namespace

void add_render_flags(CLI::App& app, RenderFlags& flags) {
  app.add_option("--camera", flags.camera, "Camera of pictures and videos: top, iso or side")
      ->check(CLI::IsMember(kCameras))
      ->type_name("VIEW");
  app.add_flag("--wires", flags.wireframe, "Draw objects as wireframes in pictures and videos");
  app.add_option("--cells", flags.cells, "Colour the cells by this channel in pictures and videos")
      ->type_name("CHANNEL");
  app.add_option("--palette", flags.palette, "Palette of --cells")
      ->check(CLI::IsMember(kPalettes))
      ->type_name("NAME");
  app.add_option("--trails", flags.trails_s, "Draw trails of the last SECONDS in pictures and videos")
      ->check(CLI::Range(0.0, 1e6))
      ->type_name("SECONDS");
  app.add_option("--picture-size", flags.size,
                 "Size of pictures (default: 1600x1000) and videos (default: 1280x720) in pixels")
      ->type_name("WxH");
}

RenderOptions parse_render_options(const RenderFlags& flags) {
  RenderOptions options;
  options.camera = static_cast<view::CameraPreset>(index_of(kCameras, flags.camera));
  options.wireframe = flags.wireframe;
  options.overlay.channel = flags.cells;
  options.overlay.palette = view::kPalettes[index_of(kPalettes, flags.palette)];
  options.overlay.trails = flags.trails_s > 0.0;
  options.overlay.trail_length_s = flags.trails_s;
  if (!flags.size.empty()) options.pixel_size = parse_pixel_size(flags.size);
  return options;
}

}  // namespace smartsurf::run
