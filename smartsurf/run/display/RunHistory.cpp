#include "smartsurf/run/display/RunHistory.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace smartsurf::run {
namespace {

constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

std::size_t frame_bytes(const RunHistory::Frame& frame) {
  constexpr std::size_t kBytesPerObject = sizeof(scene::ObjectId) + 13 * sizeof(float);
  const scene::Snapshot& s = frame.snapshot;
  return sizeof frame + s.object_count() * kBytesPerObject +
         (s.height.size() + s.skin_height.size() + frame.channels.size()) * sizeof(float) +
         s.actuator_state.size() * sizeof(scene::ActuatorState) + frame.metrics.size() * sizeof(double);
}

}  // namespace

scene::Metrics RunHistory::metrics(const Frame& frame) const {
  scene::Metrics named;
  for (std::size_t i = 0; i < frame.metrics.size(); ++i)
    named.emplace_back(signals_[i].quantity, frame.metrics[i]);
  return named;
}

void RunHistory::clear() {
  frames_.clear();
  channels_.clear();
  signals_.clear();
  bytes_ = oldest_ = 0;
  added_ = 0;
  full_ = false;
}

void RunHistory::add(const scene::Snapshot& snapshot, std::span<const view::Channel> channels,
                     std::span<const scene::Metric> metrics) {
  if (channels_.empty())
    for (std::size_t offset = 0; const view::Channel& channel : channels) {
      const std::size_t cells =
          channels_.empty() ? 0 : channel.values.size();  // the first is in the snapshot
      channels_.push_back({channel.name, offset, cells});
      offset += cells;
    }
  for (std::size_t i = signals_.size(); i < metrics.size(); ++i)
    signals_.push_back({view::Signal::Kind::kMetric, metrics[i].first, 0, 0, 0});
  full_ = full_ || (frames_.size() >= 2 && bytes_ + frame_bytes(frames_.back()) > max_bytes_);
  if (!full_) frames_.emplace_back();
  Frame& frame = full_ ? frames_[oldest_] : frames_.back();  // the oldest one's memory is reused
  if (full_) oldest_ = (oldest_ + 1) % frames_.size();
  frame.snapshot = snapshot;
  frame.channels.clear();
  for (std::size_t i = 1; i < channels.size(); ++i)
    frame.channels.insert(frame.channels.end(), channels[i].values.begin(), channels[i].values.end());
  frame.metrics.clear();
  for (const auto& [name, value] : metrics) frame.metrics.push_back(value);
  ++added_;
  if (!full_) bytes_ += frame_bytes(frame);
}

std::span<const float> RunHistory::channel(const Frame& frame, std::size_t index) const {
  if (index == 0) return frame.snapshot.height;
  if (index >= channels_.size()) return {};
  return std::span(frame.channels).subspan(channels_[index].offset, channels_[index].cells);
}

double RunHistory::cell_value(const view::Signal& signal, const Frame& frame) const {
  const std::size_t index =
      std::ranges::find(channels_, signal.quantity, &StoredChannel::name) - channels_.begin();
  const std::span<const float> values =
      index < channels_.size() ? channel(frame, index) : std::span<const float>();
  const std::size_t cell = signal.row * columns_ + signal.column;
  return signal.column < columns_ && cell < values.size() ? double{values[cell]} : kMissing;
}

double RunHistory::value(const view::Signal& signal, const Frame& frame) const {
  switch (signal.kind) {
    case view::Signal::Kind::kObject:
      return view::object_value(signal, frame.snapshot);
    case view::Signal::Kind::kCell:
      return cell_value(signal, frame);
    default:
      break;
  }
  if (signal.quantity == "contacts" && signal.kind == view::Signal::Kind::kRun)
    return frame.snapshot.contact_count;
  if (signal.quantity == "objects" && signal.kind == view::Signal::Kind::kRun)
    return static_cast<double>(frame.snapshot.object_count());
  const std::size_t index = std::ranges::find(signals_, signal) - signals_.begin();
  return index < frame.metrics.size() ? frame.metrics[index] : kMissing;
}

void RunHistory::read(const view::Signal& signal, std::uint64_t first, std::span<double> values) const {
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = value(signal, of(first + i));
}

std::vector<view::Signal> RunHistory::run_signals() const {
  std::vector<view::Signal> signals = signals_;
  for (const char* quantity : {"contacts", "objects"})
    signals.push_back({view::Signal::Kind::kRun, quantity, 0, 0, 0});
  return signals;
}

}  // namespace smartsurf::run
