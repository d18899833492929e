#include "apron/run/media/CameraSources.h"

#include <algorithm>
#include <filesystem>
#include <vector>

#include "apron/run/media/ImageFile.h"
#include "apron/run/media/MediaFile.h"
#include "apron/run/media/V4l2Camera.h"
#include "apron/run/media/Y4mReader.h"
#include "common/files/Inputs.h"

namespace apron::run {
namespace {

namespace fs = std::filesystem;

class VideoFileCamera final : public Camera {
 public:
  explicit VideoFileCamera(const std::string& path) : reader_(path) {}
  void read(const vm::Plane& to, const std::atomic<bool>&) override {
    resample_center_crop(reader_.next_frame(), to);
  }

 private:
  Y4mReader reader_;
};

// Shows one picture after the other, and after the last the first.
class PictureCamera final : public Camera {
 public:
  explicit PictureCamera(std::vector<std::string> files) : files_(std::move(files)) {}
  void read(const vm::Plane& to, const std::atomic<bool>&) override {
    if (files_.size() > 1 || frame_.pixels.empty()) frame_ = read_frame(files_[next_]);
    next_ = (next_ + 1) % files_.size();
    resample_center_crop(frame_, to);
  }

 private:
  std::vector<std::string> files_;
  std::size_t next_ = 0;
  GreyFrame frame_;
};

std::vector<std::string> pictures_in(const std::string& folder) {
  std::vector<std::string> files;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error))
    if (is_image_name(entry.path().string())) files.push_back(entry.path().string());
  if (error) throw_refused(folder, "cannot be read: " + error.message());
  if (files.empty()) throw_refused(folder, "has no picture: .png, .pgm, .jpg, .jpeg or .bmp");
  std::ranges::sort(files);
  return files;
}

}  // namespace

std::unique_ptr<Camera> open_camera(const std::string& path) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) return std::make_unique<PictureCamera>(pictures_in(path));
  if (is_image_name(path)) return std::make_unique<PictureCamera>(std::vector{path});
  if (extension(path) == "y4m") return std::make_unique<VideoFileCamera>(path);
  return std::make_unique<V4l2Camera>(path, open_v4l2_device(path));
}

void note_camera(const std::string& path) {
  std::error_code error;
  common::note_input(fs::path(path));
  for (const fs::directory_entry& entry : fs::directory_iterator(path, error))
    if (is_image_name(entry.path().string())) common::note_input(entry.path());
}

}  // namespace apron::run
