#include "smartsurf/run/Look.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::run {
namespace {

const std::vector<std::string> kCameras = {"top", "iso", "side"};
const std::vector<std::string> kPalettes(view::kPaletteNames.begin(), view::kPaletteNames.end());

std::size_t index_in(const std::vector<std::string>& names, const std::string& name) {
  return static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
}

constexpr int kLeastEdge = 16, kMostEdge = 8192;  // pixels

PictureSize size_of(const std::string& text) {
  PictureSize size{};
  int read = 0;
  const bool whole = std::sscanf(text.c_str(), "%dx%d%n", &size.width, &size.height, &read) == 2 &&
                     read == static_cast<int>(text.size());
  if (!whole || std::min(size.width, size.height) < kLeastEdge ||
      std::max(size.width, size.height) > kMostEdge)
    throw scene::InputError("--picture-size " + text + ": must be as 1600x1000, each edge from " +
                            std::to_string(kLeastEdge) + " to " + std::to_string(kMostEdge) + " pixels");
  return size;
}

}  // namespace

void add_look_flags(CLI::App& app, LookFlags& flags) {
  app.add_option("--camera", flags.camera, "Of pictures and videos: top, iso or side")
      ->check(CLI::IsMember(kCameras))
      ->type_name("VIEW");
  app.add_flag("--wires", flags.wires, "In pictures and videos: objects as wires");
  app.add_option("--cells", flags.cells, "In pictures and videos: the channel that colours the cells")
      ->type_name("CHANNEL");
  app.add_option("--palette", flags.palette, "Its palette")
      ->check(CLI::IsMember(kPalettes))
      ->type_name("NAME");
  app.add_option("--trails", flags.trails_s, "In pictures and videos: the objects' ways of the last seconds")
      ->check(CLI::Range(0.0, 1e6))
      ->type_name("SECONDS");
  app.add_option("--picture-size", flags.size,
                 "Of pictures (1600x1000 if not given) and videos (1280x720), in pixels")
      ->type_name("WxH");
}

Look look_of(const LookFlags& flags) {
  Look look;
  look.camera = static_cast<view::Preset>(index_in(kCameras, flags.camera));
  look.wires = flags.wires;
  look.overlay.channel = flags.cells;
  look.overlay.palette = static_cast<view::Palette>(index_in(kPalettes, flags.palette));
  look.overlay.trails = flags.trails_s > 0.0;
  look.overlay.trail_s = flags.trails_s;
  if (!flags.size.empty()) look.size = size_of(flags.size);
  return look;
}

}  // namespace smartsurf::run
