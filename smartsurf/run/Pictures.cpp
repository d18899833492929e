#include "smartsurf/run/Pictures.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <utility>

#include "smartsurf/view/OffscreenView.h"
#include "smartsurf/view/VideoWriter.h"

namespace smartsurf::run {
namespace {

constexpr PictureSize kPicture{1600, 1000}, kFilm{1280, 720};
constexpr int kFilmFramesPerSecond = 30;

// The videos' format stores colours for blocks of two by two pixels.
PictureSize film_size(const Look& look) {
  const PictureSize size = look.size.value_or(kFilm);
  if (size.width % 2 != 0 || size.height % 2 != 0)
    throw scene::InputError(
        fmt::format("--picture-size {}x{}: a video needs even numbers", size.width, size.height));
  return size;
}

// Throws when there is no such channel; that its values are not there is no mistake.
void require_channel(const view::Moment& moment, const std::string& name) {
  std::vector<std::string> known;
  for (const view::Channel& channel : moment.channels) {
    if (channel.name == name) return;
    known.push_back(channel.name);
  }
  const std::string near = scene::nearest_name(name, known);
  throw scene::InputError(fmt::format("--cells {}: no such channel{}; known: {}", name,
                                      near.empty() ? "" : fmt::format(" (did you mean '{}'?)", near),
                                      fmt::join(known, ", ")));
}

}  // namespace

Pictures::Pictures(std::vector<Screenshot> screenshots, const std::string& video_file, const Look& look,
                   const scene::SceneSpec& scene)
    : scene_(scene), look_(look), overlay_(scene.surface), pending_(std::move(screenshots)) {
  if (!pending_.empty() || !video_file.empty()) view::OffscreenView::require_view();
  overlay_.settings = look.overlay;
  if (video_file.empty()) return;
  const PictureSize size = film_size(look);
  video_ = std::make_unique<view::VideoWriter>(video_file, size.width, size.height, kFilmFramesPerSecond);
}

Pictures::~Pictures() = default;

void Pictures::take(const view::Moment& moment) {
  if (!all_taken()) overlay_.watch(moment);
  if (video_) film(moment);
  if (pending_.empty()) return;
  std::erase_if(pending_, [&](const Screenshot& shot) {
    const bool due = shot.at_s && moment.snapshot.time_s >= *shot.at_s - 1e-9;
    if (due) write_picture(moment, shot.file);
    return due;
  });
}

void Pictures::take_last(const view::Moment& moment) {
  for (const Screenshot& shot : std::exchange(pending_, {})) write_picture(moment, shot.file);
  if (!video_) return;
  video_->finish();
  video_.reset();
}

view::Image Pictures::draw(view::OffscreenView& view, const view::Moment& moment, const PictureSize& size) {
  if (!look_.overlay.channel.empty()) require_channel(moment, look_.overlay.channel);
  view::DrawOptions options;
  if (look_.wires) options.style = view::Style::kWireframe;
  overlay_.apply(moment, nullptr, options);
  if (overlay_.heat()) options.legend = &*overlay_.heat();
  const view::Camera camera =
      view::Camera::framing(scene_.surface, look_.camera, static_cast<double>(size.width) / size.height);
  return view.draw(moment.snapshot, moment.catalogue, camera, options, size.width, size.height);
}

void Pictures::write_picture(const view::Moment& moment, const std::string& file) {
  if (!pictures_) pictures_ = std::make_unique<view::OffscreenView>(scene_);
  view::write_png(file, draw(*pictures_, moment, look_.size.value_or(kPicture)));
}

// The video's frame rate counts simulated time, so that it plays in real time whatever the pace of the run.
void Pictures::film(const view::Moment& moment) {
  const double frames_due = moment.snapshot.time_s * kFilmFramesPerSecond + 1e-6;
  if (frames_due < static_cast<double>(film_frames_)) return;
  if (!film_) film_ = std::make_unique<view::OffscreenView>(scene_, view::Detail::kVideo);
  const view::Image image = draw(*film_, moment, film_size(look_));
  // A control period longer than a frame shows the same picture for as many frames as it lasts.
  for (; frames_due >= static_cast<double>(film_frames_); ++film_frames_) video_->add(image);
}

}  // namespace smartsurf::run
