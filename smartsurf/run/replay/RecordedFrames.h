// The frames of a recording as the view takes them.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "smartsurf/record/Recording.h"
#include "smartsurf/scene/ChannelKind.h"
#include "smartsurf/view/interaction/Controls.h"
#include "smartsurf/view/model/Signal.h"

namespace smartsurf::run {

class RecordedFrames final : public view::History {
 public:
  // The recording must outlive this object.
  explicit RecordedFrames(const record::Recording& recording);

  // Valid until the next call.
  view::FrameInput frame_input(std::size_t frame);
  // The channels, without values.
  std::span<const view::Channel> channels() const { return channels_; }
  // The events of the run: when it reached its goal, and when the user intervened.
  const std::vector<view::EventMark>& marks() const { return marks_; }

  std::uint64_t begin() const override { return 0; }
  std::uint64_t end() const override { return recording_.frames(); }
  double time_s(std::uint64_t frame) const override { return recording_.times()[frame]; }
  const scene::Snapshot& snapshot(std::uint64_t frame) const override;
  // The first call for a signal reads it for all frames.
  void read(const view::Signal& signal, std::uint64_t first, std::span<double> values) const override;
  std::vector<view::Signal> run_signals() const override;

 private:
  struct Source {
    record::ChannelGroup group;
    std::string name;
    int component;
  };
  void add_channels(record::ChannelGroup group, scene::ChannelKind kind);
  void load(std::size_t frame);
  std::vector<double> read_all(const view::Signal& signal) const;

  const record::Recording& recording_;
  std::optional<std::size_t> loaded_frame_;
  scene::Snapshot snapshot_;
  mutable scene::Snapshot past_snapshot_;
  std::vector<view::Channel> channels_;
  std::vector<Source> sources_;  // of channels_[1 …]
  std::vector<std::vector<float>> values_;
  std::vector<view::EventMark> marks_;
  mutable std::map<std::string, std::vector<double>> signals_;  // read so far
};

}  // namespace smartsurf::run
