#include "apron/run/host/LocalHost.h"

#include <algorithm>
#include <cstdio>

#include "apron/program/CallSite.h"
#include "apron/run/media/ArrayFile.h"
#include "apron/run/media/CameraSources.h"
#include "apron/run/media/ImageFile.h"
#include "apron/run/media/MediaError.h"
#include "common/text/Printable.h"

namespace apron::run {

using vm::HostStatus;

namespace {
constexpr const char* kNoSurface = "there is no surface: run with --shm NAME";
}

LocalHost::LocalHost(Parameters parameters, const std::atomic<bool>& stop, HostEnvironment environment)
    : parameters_(std::move(parameters)),
      stop_(stop),
      cameras_(std::move(environment.cameras)),
      timers_(std::move(environment.clock_s)),
      frames_(environment.frame_rate),
      keys_(std::move(environment.keys)),
      files_(std::move(environment.files)) {}

void LocalHost::restart() {
  clip_.reset();
  camera_.reset();
  frames_.restart();
  keys_.restart();
}

void LocalHost::print(std::string_view text) { common::print_output(text); }

std::string LocalHost::message() const { return message_.empty() ? kNoSurface : message_; }

void LocalHost::flush_output() { std::fflush(stdout); }

std::optional<float> LocalHost::parameter(std::string_view name) {
  const auto found = parameters_.find(name);
  return found == parameters_.end() ? std::nullopt : std::optional<float>(found->second);
}

HostStatus LocalHost::report_status(HostStatus status, std::string message) {
  message_ = std::move(message);
  return status;
}

template <class Media>
HostStatus LocalHost::guard_media_errors(const Media& operation) {
  try {
    operation();
    return HostStatus::kOk;
  } catch (const MediaError& error) {
    return report_status(error.status(), error.what());
  } catch (const std::bad_alloc&) {
    return report_status(HostStatus::kFailed, "there is not enough memory for the file");
  }
}

std::string LocalHost::readable(std::string_view file) const {
  files_.require_readable(std::string(file));
  return std::string(file);
}
std::string LocalHost::writable(std::string_view file) const {
  files_.require_writable(std::string(file));
  return std::string(file);
}

HostStatus LocalHost::open_array(std::string_view file, vm::Plane to) {
  return guard_media_errors([&] { read_array(readable(file), to); });
}
HostStatus LocalHost::save_array(std::string_view file, vm::ConstPlane from) {
  return guard_media_errors([&] { write_array(writable(file), from); });
}
HostStatus LocalHost::open_image(std::string_view file, vm::Plane to) {
  return guard_media_errors([&] { read_image(readable(file), to); });
}
HostStatus LocalHost::save_image(std::string_view file, vm::ConstPlane from) {
  return guard_media_errors([&] { write_image(writable(file), from); });
}

HostStatus LocalHost::open_clip(std::string_view file) {
  return guard_media_errors([&] { clip_ = std::make_unique<Y4mReader>(readable(file)); });
}
HostStatus LocalHost::read_clip(vm::Plane to) {
  if (clip_ == nullptr)
    return report_status(HostStatus::kRefused, "no video is open: video.clip.open('file.y4m')");
  return guard_media_errors([&] { clip_->read_frame(to); });
}
HostStatus LocalHost::open_camera(int number) {
  const std::size_t index = number;
  const std::string path = index < cameras_.size() ? cameras_[index] : "/dev/video" + std::to_string(number);
  camera_.reset();  // before opening: a device can be opened only once
  return guard_media_errors([&] { camera_ = run::open_camera(path); });
}
HostStatus LocalHost::read_camera(vm::Plane to) {
  if (camera_ == nullptr) return report_status(HostStatus::kRefused, "no camera is open: webcam.open(0)");
  return guard_media_errors([&] { camera_->read(to, stop_); });
}

HostStatus LocalHost::wait(double seconds) {
  flush_output();
  return timers_.wait(seconds, stop_);
}

std::string LocalHost::load_modules(const program::Program& program,
                                    const std::vector<std::string>& permitted,
                                    const std::vector<std::string>& directories) {
  const auto report = [&](const program::Module& module, const std::string& problem) {
    return program::format_call_site(program, module.location) + "error: " + problem;
  };
  for (const program::Module& module : program.modules)
    if (std::ranges::find(permitted, module.name) == permitted.end())
      return report(module, "!module('" + module.name + "') loads native code: --module " + module.name +
                                " on the command line permits it");
  for (const program::Module& module : program.modules)
    if (const std::string problem = modules_.load(module.name, directories); !problem.empty())
      return report(module, problem);
  return {};
}

HostStatus LocalHost::call_plugin(std::string_view module, int operation,
                                  std::span<const vm::PluginArgument> arguments, vm::Plane to, float* value) {
  std::string error = modules_.call(module, operation, arguments, to, value);
  return error.empty() ? HostStatus::kOk : report_status(HostStatus::kFailed, std::move(error));
}

HostStatus LocalHost::sense(std::string_view, vm::Plane) {
  return report_status(HostStatus::kRefused, kNoSurface);
}
HostStatus LocalHost::actuate(std::string_view, vm::ConstPlane) {
  return report_status(HostStatus::kRefused, kNoSurface);
}
HostStatus LocalHost::actuate(std::string_view, float) {
  return report_status(HostStatus::kRefused, kNoSurface);
}
HostStatus LocalHost::step() {
  flush_output();
  return frames_.advance(stop_);
}

}  // namespace apron::run
