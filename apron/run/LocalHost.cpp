#include "apron/run/LocalHost.h"

#include <cstdio>

#include "apron/run/ArrayFile.h"
#include "apron/run/ImageFile.h"
#include "apron/run/MediaError.h"

namespace apron::run {

using vm::HostStatus;

namespace {
constexpr const char* kNoSurface = "there is no surface: run with --shm NAME";
}

LocalHost::LocalHost(Parameters parameters, const std::atomic<bool>& stop, Surroundings surroundings)
    : parameters_(std::move(parameters)),
      stop_(stop),
      cameras_(std::move(surroundings.cameras)),
      timers_(std::move(surroundings.clock_s)) {}

void LocalHost::print(std::string_view text) { std::fwrite(text.data(), 1, text.size(), stdout); }

std::string LocalHost::message() const { return message_.empty() ? kNoSurface : message_; }

void LocalHost::flush() { std::fflush(stdout); }

std::optional<float> LocalHost::parameter(std::string_view name) {
  const auto found = parameters_.find(name);
  return found == parameters_.end() ? std::nullopt : std::optional<float>(found->second);
}

HostStatus LocalHost::report(HostStatus status, std::string message) {
  message_ = std::move(message);
  return status;
}

template <class Media>
HostStatus LocalHost::media(const Media& work) {
  try {
    work();
    return HostStatus::kOk;
  } catch (const MediaError& error) {
    return report(error.status(), error.what());
  } catch (const std::bad_alloc&) {
    return report(HostStatus::kFailed, "there is not enough memory for the file");
  }
}

HostStatus LocalHost::open_array(std::string_view file, vm::Plane to) {
  return media([&] { read_array(std::string(file), to); });
}
HostStatus LocalHost::save_array(std::string_view file, vm::ConstPlane from) {
  return media([&] { write_array(std::string(file), from); });
}
HostStatus LocalHost::open_image(std::string_view file, vm::Plane to) {
  return media([&] { read_image(std::string(file), to); });
}
HostStatus LocalHost::save_image(std::string_view file, vm::ConstPlane from) {
  return media([&] { write_image(std::string(file), from); });
}

HostStatus LocalHost::open_clip(std::string_view file) {
  return media([&] { clip_ = std::make_unique<VideoClip>(std::string(file)); });
}
HostStatus LocalHost::read_clip(vm::Plane to) {
  if (clip_ == nullptr) return report(HostStatus::kRefused, "no video is open: video.clip.open('file.y4m')");
  return media([&] { clip_->read(to); });
}
HostStatus LocalHost::open_camera(int number) {
  if (number < 0) return report(HostStatus::kRefused, "a camera's number is a whole number from 0");
  const auto n = static_cast<std::size_t>(number);
  const std::string path = n < cameras_.size() ? cameras_[n] : "/dev/video" + std::to_string(number);
  camera_.reset();  // a camera can be opened only once
  return media([&] { camera_ = run::open_camera(path); });
}
HostStatus LocalHost::read_camera(vm::Plane to) {
  if (camera_ == nullptr) return report(HostStatus::kRefused, "no camera is open: webcam.open(0)");
  return media([&] { camera_->read(to, stop_); });
}

HostStatus LocalHost::wait(double seconds) {
  flush();
  return timers_.wait(seconds, stop_);
}

std::string LocalHost::load_modules(const std::vector<std::string>& names,
                                    const std::vector<std::string>& directories) {
  for (const std::string& name : names)
    if (std::string wrong = modules_.load(name, directories); !wrong.empty()) return wrong;
  return {};
}

HostStatus LocalHost::call_plugin(std::string_view module, int operation,
                                  std::span<const vm::PluginArgument> arguments, vm::Plane to, float* value) {
  std::string wrong = modules_.call(module, operation, arguments, to, value);
  return wrong.empty() ? HostStatus::kOk : report(HostStatus::kFailed, std::move(wrong));
}

HostStatus LocalHost::sense(std::string_view, vm::Plane) { return report(HostStatus::kRefused, kNoSurface); }
HostStatus LocalHost::actuate(std::string_view, vm::ConstPlane) {
  return report(HostStatus::kRefused, kNoSurface);
}
HostStatus LocalHost::actuate(std::string_view, float) { return report(HostStatus::kRefused, kNoSurface); }
HostStatus LocalHost::step() { return report(HostStatus::kRefused, kNoSurface); }

}  // namespace apron::run
