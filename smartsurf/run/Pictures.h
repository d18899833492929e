// The screenshots and the video of a run or a replay: fed with every moment in order, writes the pictures
// that are due.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "smartsurf/run/Look.h"
#include "smartsurf/run/RunOptions.h"
#include "smartsurf/view/Image.h"
#include "smartsurf/view/Moment.h"

namespace smartsurf::view {
class OffscreenView;
class VideoWriter;
}  // namespace smartsurf::view

namespace smartsurf::run {

class Pictures {
 public:
  // Begins the video if there is one. Throws scene::InputError when it cannot be made.
  Pictures(std::vector<Screenshot>, const std::string& video_file, const Look&, const scene::SceneSpec&);
  ~Pictures();

  // Writes what is due at the moment's time. Throws scene::InputError when the channel that is to colour the
  // cells does not exist.
  void take(const view::Moment&);
  // At the end: the screenshots that are left, and the video's last words.
  void take_last(const view::Moment&);
  // Nothing more will be due, however long it goes on, but for the last pictures.
  bool all_taken() const { return pending_.empty() && !video_; }

 private:
  view::Image draw(view::OffscreenView&, const view::Moment&, const PictureSize&);
  void write_picture(const view::Moment&, const std::string& file);
  void film(const view::Moment&);

  scene::SceneSpec scene_;
  Look look_;
  view::Overlay overlay_;
  std::vector<Screenshot> pending_;
  std::unique_ptr<view::OffscreenView> pictures_, film_;
  std::unique_ptr<view::VideoWriter> video_;
  long film_frames_ = 0;
};

}  // namespace smartsurf::run
