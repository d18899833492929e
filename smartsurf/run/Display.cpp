#include "smartsurf/run/Display.h"

#include <algorithm>
#include <limits>

#include "smartsurf/view/OffscreenView.h"

namespace smartsurf::view { class Window {}; }
namespace smartsurf::run {
namespace {
constexpr int kPictureWidth = 1600, kPictureHeight = 1000;
}

Display::Display(const RunOptions& options, const scene::SceneSpec& scene)
    : scene_(scene), pending_(options.screenshots) {}

Display::~Display() = default;

void Display::refresh(const Simulation&, const DisplayStatus&, Controls&) {}

void Display::take_screenshots(const Simulation& simulation, bool at_end) {
  if (pending_.empty()) return;
  const double now = simulation.snapshot().time_s;
  std::erase_if(pending_, [&](const Screenshot& shot) {
    const bool due = at_end || (shot.at_s && now >= *shot.at_s - 1e-9);
    if (due) write_picture(simulation, shot.file);
    return due;
  });
}

void Display::write_picture(const Simulation& simulation, const std::string& file) {
  if (!offscreen_) offscreen_ = std::make_unique<view::OffscreenView>(scene_);
  const auto camera =
      view::Camera::framing(scene_.surface, view::Preset::kIso, static_cast<double>(kPictureWidth) / kPictureHeight);
  view::write_png(file, offscreen_->draw(simulation.snapshot(), simulation.catalogue(), camera, {}, kPictureWidth,
                                         kPictureHeight));
  pictures_.push_back(file);
}

}  // namespace smartsurf::run
