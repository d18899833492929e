#include "smartsurf/run/Display.h"

#include <algorithm>
#include <utility>

#include "smartsurf/run/ControllerProcess.h"
#include "smartsurf/view/OffscreenView.h"
#include "smartsurf/view/VideoWriter.h"
#include "smartsurf/view/Window.h"

namespace smartsurf::run {
namespace {

using namespace std::chrono_literals;

constexpr int kPictureWidth = 1600, kPictureHeight = 1000;
constexpr int kFilmWidth = 1280, kFilmHeight = 720, kFilmFramesPerSecond = 30;
// Drawing may take tens of milliseconds without a graphics card: leave most of the time to the simulation.
constexpr auto kFrameInterval = 40ms;

view::Camera framing(const scene::SceneSpec& scene, int width, int height) {
  return view::Camera::framing(scene.surface, view::Preset::kIso, static_cast<double>(width) / height);
}

view::Status status_of(const DisplayStatus& s, bool paused) {
  view::Status status;
  status.mode = s.mode == RunMode::kTimeStep ? "time-step" : "passive";
  status.controller = s.controller;
  status.paused = paused;
  status.requested_pace = s.requested_pace.value_or(0.0);
  status.actual_pace = s.real_time_factor;
  status.physics_ms = s.physics_ms;
  status.purity = s.purity;
  return status;
}

}  // namespace

Display::Display(const RunOptions& options, const scene::SceneSpec& scene)
    : scene_(scene), pending_(options.screenshots) {
  if (!options.video_file.empty())
    video_ = std::make_unique<view::VideoWriter>(options.video_file, kFilmWidth, kFilmHeight,
                                                 kFilmFramesPerSecond);
  if (!options.window) return;
  if (!view::Window::display_available())
    throw scene::InputError("--window: there is no display here; run without it, or set DISPLAY");
  const bool beside_another = is_apron_program(options.controller);
  window_ = std::make_unique<view::Window>(scene_, "smartsurf: " + options.experiment, 1280, 720,
                                           beside_another ? view::Place::kLeft : view::Place::kAnywhere);
}

Display::~Display() = default;

void Display::refresh(const Simulation& simulation, const DisplayStatus& told, Controls& controls) {
  if (!window_) return;
  const view::Status status = status_of(told, controls.paused);
  const auto now = std::chrono::steady_clock::now();
  view::Commands commands;
  if (now < next_frame_) {
    commands = window_->poll(status);
  } else {
    commands = window_->frame(simulation.snapshot(), simulation.catalogue(), status);
    // Counted from the frame's end: drawing never takes more than about half of the time.
    const auto drawn = std::chrono::steady_clock::now();
    next_frame_ =
        drawn + std::max<std::chrono::steady_clock::duration>(kFrameInterval - (drawn - now), drawn - now);
  }
  if (commands.toggle_pause) controls.paused = !controls.paused;
  controls.single_steps += commands.steps;
  controls.quit |= commands.quit;
  if (commands.pace) {
    controls.pace_changed = true;
    controls.pace = *commands.pace > 0.0 ? commands.pace : std::nullopt;
  }
}

void Display::take_pictures(const Simulation& simulation) {
  if (video_) film(simulation);
  if (pending_.empty()) return;
  const double now_s = simulation.snapshot().time_s;
  std::erase_if(pending_, [&](const Screenshot& shot) {
    const bool due = shot.at_s && now_s >= *shot.at_s - 1e-9;
    if (due) write_picture(simulation, shot.file);
    return due;
  });
}

void Display::take_last_pictures(const Simulation& simulation) {
  for (const Screenshot& shot : std::exchange(pending_, {})) write_picture(simulation, shot.file);
  if (!video_) return;
  video_->finish();
  video_.reset();
}

void Display::write_picture(const Simulation& simulation, const std::string& file) {
  if (!pictures_) pictures_ = std::make_unique<view::OffscreenView>(scene_);
  view::write_png(file, pictures_->draw(simulation.snapshot(), simulation.catalogue(),
                                        framing(scene_, kPictureWidth, kPictureHeight), {}, kPictureWidth,
                                        kPictureHeight));
}

// The video's frame rate counts simulated time, so that it plays in real time whatever the pace of the run.
void Display::film(const Simulation& simulation) {
  if (simulation.snapshot().time_s * kFilmFramesPerSecond < static_cast<double>(film_frames_) - 1e-6) return;
  if (!film_) film_ = std::make_unique<view::OffscreenView>(scene_, view::Detail::kVideo);
  const view::Image image =
      film_->draw(simulation.snapshot(), simulation.catalogue(), framing(scene_, kFilmWidth, kFilmHeight), {},
                  kFilmWidth, kFilmHeight);
  // A control period longer than a frame shows the same picture for as many frames as it lasts.
  while (simulation.snapshot().time_s * kFilmFramesPerSecond >= static_cast<double>(film_frames_) - 1e-6) {
    video_->add(image);
    ++film_frames_;
  }
}

}  // namespace smartsurf::run
