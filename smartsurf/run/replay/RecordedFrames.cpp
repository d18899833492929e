#include "smartsurf/run/replay/RecordedFrames.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartsurf/record/plot/TimeSeries.h"
#include "smartsurf/run/display/ViewChannels.h"

namespace smartsurf::run {

RecordedFrames::RecordedFrames(const record::Recording& recording) : recording_(recording) {
  const scene::SurfaceSpec& surface = recording.spec().surface;
  channels_ = {height_channel(surface)};
  add_channels(record::ChannelGroup::kSensors, scene::ChannelKind::kSensor);
  add_channels(record::ChannelGroup::kActuators, scene::ChannelKind::kCommand);
  add_channels(record::ChannelGroup::kRegisters, scene::ChannelKind::kRegister);
  if (const auto time_s = recording.success_s())
    marks_.push_back({view::EventMark::Kind::kSuccess, *time_s, "success"});
  if (const auto tick = recording.first_interaction_tick()) {
    const double time_s = static_cast<double>(*tick) * recording.spec().world.control_period_s;
    marks_.push_back({view::EventMark::Kind::kTouched, time_s, "the user intervened"});
  }
  std::ranges::sort(marks_, {}, &view::EventMark::time_s);
}

// A channel with several components is one for each.
void RecordedFrames::add_channels(record::ChannelGroup group, scene::ChannelKind kind) {
  const std::size_t cells = recording_.spec().surface.cell_count();
  for (const std::string& name : recording_.channel_names(group)) {
    const std::size_t numbers =
        recording_.frames() > 0 ? recording_.read_channel(group, name, 0).size() : cells;
    const int components = std::max(1, static_cast<int>(numbers / std::max<std::size_t>(cells, 1)));
    const record::Recording::ChannelInfo info = recording_.channel_info(group, name);
    for (int i = 0; i < components; ++i) {
      channels_.push_back({component_name(full_name(kind, name), i, components),
                           info.unit,
                           {},
                           static_cast<float>(info.minimum),
                           static_cast<float>(info.maximum),
                           info.origin,
                           info.direction,
                           kind});
      sources_.push_back({group, name, i});
    }
  }
}

view::FrameInput RecordedFrames::frame_input(std::size_t frame) {
  if (loaded_frame_ != frame) load(frame);
  return {snapshot_, recording_.spec().objects, channels_, {}, this};
}

void RecordedFrames::load(std::size_t frame) {
  loaded_frame_ = frame;
  snapshot_ = recording_.read_snapshot(frame);
  const scene::SurfaceSpec& surface = recording_.spec().surface;
  const std::size_t cells = surface.cell_count();
  channels_[0].values = snapshot_.height;
  values_.resize(sources_.size());
  std::vector<float> numbers;  // rows × columns × components
  for (std::size_t i = 0; i < sources_.size(); ++i) {
    const Source& source = sources_[i];
    if (source.component == 0) numbers = recording_.read_channel(source.group, source.name, frame);
    const std::size_t components = std::max<std::size_t>(1, numbers.size() / std::max<std::size_t>(cells, 1));
    values_[i].resize(cells);
    for (std::size_t cell = 0; cell < cells && (cell + 1) * components <= numbers.size(); ++cell)
      values_[i][cell] = numbers[cell * components + source.component];
    channels_[1 + i].values = values_[i];
  }
}

const scene::Snapshot& RecordedFrames::snapshot(std::uint64_t frame) const {
  past_snapshot_ = recording_.read_snapshot(frame);
  return past_snapshot_;
}

std::vector<double> RecordedFrames::read_all(const view::Signal& signal) const {
  switch (signal.kind) {
    case view::Signal::Kind::kObject:
      return record::time_series(recording_, signal.quantity, {std::to_string(signal.object)})
          .curves[0]
          .values;
    case view::Signal::Kind::kCell: {
      const std::size_t index =
          std::ranges::find(channels_, signal.quantity, &view::Channel::name) - channels_.begin();
      if (index == 0)
        return record::time_series(recording_, "height",
                                   {std::to_string(signal.row) + "," + std::to_string(signal.column)})
            .curves[0]
            .values;
      if (index == channels_.size()) return {};
      const Source& source = sources_[index - 1];
      const std::size_t components = recording_.channel_components(source.group, source.name);
      const std::vector<float> all =
          recording_.read_cell_history(source.group, source.name, signal.row, signal.column);
      std::vector<double> values;
      for (std::size_t i = source.component; i < all.size(); i += components) values.push_back(all[i]);
      return values;
    }
    case view::Signal::Kind::kRun:
      return record::time_series(recording_, signal.quantity, {}).curves[0].values;
    case view::Signal::Kind::kMetric:
      return recording_.read_metric(signal.quantity);
  }
  return {};
}

void RecordedFrames::read(const view::Signal& signal, std::uint64_t first, std::span<double> values) const {
  auto known = signals_.find(to_string(signal));
  if (known == signals_.end()) {
    std::vector<double> all;
    try {
      all = read_all(signal);
    } catch (const scene::InputError&) {
      // The recording lacks it.
    }
    all.resize(recording_.frames(), std::numeric_limits<double>::quiet_NaN());
    known = signals_.emplace(to_string(signal), std::move(all)).first;
  }
  std::ranges::copy_n(known->second.begin() + first, std::ssize(values), values.begin());
}

std::vector<view::Signal> RecordedFrames::run_signals() const {
  std::vector<view::Signal> signals;
  for (const char* quantity : view::kRunQuantities)
    signals.push_back({view::Signal::Kind::kRun, quantity, 0, 0, 0});
  for (const std::string& name : recording_.metric_names())
    signals.push_back({view::Signal::Kind::kMetric, name, 0, 0, 0});
  return signals;
}

}  // namespace smartsurf::run
