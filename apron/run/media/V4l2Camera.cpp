#include "apron/run/media/V4l2Camera.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "apron/run/media/MediaError.h"
#include "apron/run/media/MediaFile.h"

namespace apron::run {
namespace {

constexpr std::uint32_t kWidth = 640, kHeight = 480, kBufferCount = 4;
// read() polls the stop flag at this interval, and fails after kMaxPolls polls without a valid frame.
constexpr int kPollInterval_ms = 50, kMaxPolls = 100;
constexpr std::uint32_t kMaxFormats = 64;  // limit of the formats queried from a driver

v4l2_buffer make_buffer_request(std::uint32_t index = 0) {
  v4l2_buffer buffer{};
  buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  buffer.memory = V4L2_MEMORY_MMAP;
  buffer.index = index;
  return buffer;
}

}  // namespace

V4l2Camera::V4l2Camera(std::string name, std::unique_ptr<V4l2Device> device)
    : name_(std::move(name)), device_(std::move(device)) {
  require_capture_capability();
  negotiate_format();
  map_buffers();
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  control_or_throw(VIDIOC_STREAMON, &type, "start");
}

V4l2Camera::~V4l2Camera() {
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  device_->control(VIDIOC_STREAMOFF, &type);
}

void V4l2Camera::throw_error(const char* action, int error) const {
  const vm::HostStatus status = error == EBUSY ? vm::HostStatus::kRefused : vm::HostStatus::kFailed;
  throw MediaError(status, std::string("cannot ") + action + " the camera '" + name_ +
                               "': " + (error == EBUSY ? "another program uses it" : std::strerror(error)));
}

void V4l2Camera::control_or_throw(unsigned long request, void* argument, const char* action) {
  if (const int error = device_->control(request, argument); error != 0) throw_error(action, error);
}

void V4l2Camera::require_capture_capability() {
  v4l2_capability capability{};
  if (device_->control(VIDIOC_QUERYCAP, &capability) != 0) throw_refused(name_, "is not a camera");
  // A card may have several devices; device_caps describes this one.
  const std::uint32_t caps = (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? capability.device_caps
                                                                                   : capability.capabilities;
  if ((caps & V4L2_CAP_VIDEO_CAPTURE) == 0)
    throw_refused(name_, "is a video device that does not capture pictures");
  if ((caps & V4L2_CAP_STREAMING) == 0)
    throw_refused(name_, "is a camera that does not stream, which is not supported");
}

// The preferred format among those that the camera offers.
FourCc V4l2Camera::choose_format() {
  const std::span<const FourCc> supported = supported_formats();
  std::size_t best = supported.size();
  std::string offered;
  for (std::uint32_t i = 0; i < kMaxFormats; ++i) {
    v4l2_fmtdesc description{};
    description.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    description.index = i;
    if (device_->control(VIDIOC_ENUM_FMT, &description) != 0) break;
    const auto found = std::ranges::find(supported, description.pixelformat);
    best = std::min<std::size_t>(best, found - supported.begin());
    offered += (offered.empty() ? "" : ", ") + fourcc_name(description.pixelformat);
  }
  if (best == supported.size())
    throw_refused(name_, "has no supported picture format; it has: " + (offered.empty() ? "none" : offered));
  return supported[best];
}

void V4l2Camera::negotiate_format() {
  v4l2_format format{};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  format.fmt.pix.width = kWidth;
  format.fmt.pix.height = kHeight;
  format.fmt.pix.pixelformat = choose_format();
  format.fmt.pix.field = V4L2_FIELD_ANY;
  control_or_throw(VIDIOC_S_FMT, &format, "set the format of");
  const v4l2_pix_format& actual = format.fmt.pix;
  format_ = {actual.pixelformat, actual.width, actual.height, actual.bytesperline};
  const std::span<const FourCc> supported = supported_formats();
  if (std::ranges::find(supported, actual.pixelformat) == supported.end())
    throw_refused(name_, "sends pictures in the format " + fourcc_name(actual.pixelformat) +
                             ", which is not supported");
}

void V4l2Camera::map_buffers() {
  v4l2_requestbuffers request{};
  request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  request.memory = V4L2_MEMORY_MMAP;
  request.count = kBufferCount;
  control_or_throw(VIDIOC_REQBUFS, &request, "get buffers of");
  if (request.count == 0) throw_error("get buffers of", ENOMEM);
  for (std::uint32_t i = 0; i < request.count; ++i) {
    v4l2_buffer buffer = make_buffer_request(i);
    control_or_throw(VIDIOC_QUERYBUF, &buffer, "get buffers of");
    buffers_.push_back(device_->map(buffer.length, buffer.m.offset));
    if (buffers_.back().empty()) throw_error("get buffers of", ENOMEM);
    control_or_throw(VIDIOC_QBUF, &buffer, "give a buffer to");
  }
}

void V4l2Camera::wait_for_buffer(const std::atomic<bool>& stop) {
  if (stop.load(std::memory_order_relaxed)) throw MediaError(vm::HostStatus::kInterrupted, "");
  const int error = device_->wait(kPollInterval_ms);
  if (error != 0 && error != ETIMEDOUT && error != EINTR) throw_error("read", error);
}

bool V4l2Camera::dequeue_newest() {
  bool found = false;
  for (std::size_t i = 0; i < buffers_.size(); ++i) {
    v4l2_buffer buffer = make_buffer_request();
    const int error = device_->control(VIDIOC_DQBUF, &buffer);
    if (error == EAGAIN) break;
    if (error != 0 || buffer.index >= buffers_.size()) throw_error("read", error != 0 ? error : EIO);
    const std::span<const std::uint8_t> mapped = buffers_[buffer.index];
    const bool valid = (buffer.flags & V4L2_BUF_FLAG_ERROR) == 0 && buffer.bytesused <= mapped.size() &&
                       convert_to_grey(format_, mapped.first(buffer.bytesused), back_frame_);
    if (valid) std::swap(frame_, back_frame_);
    found = found || valid;
    control_or_throw(VIDIOC_QBUF, &buffer, "give a buffer to");
  }
  return found;
}

void V4l2Camera::read(const vm::Plane& to, const std::atomic<bool>& stop) {
  for (int polls = 0; !dequeue_newest(); ++polls) {
    if (polls == kMaxPolls)
      throw MediaError(vm::HostStatus::kFailed, "the camera '" + name_ + "' delivers no complete picture");
    wait_for_buffer(stop);
  }
  resample_center_crop(frame_, to);
}

}  // namespace apron::run
