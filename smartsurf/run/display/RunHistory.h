// The latest states of a run, for looking back, plots and trails. The simulation itself is not rewound.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "smartsurf/scene/NamedValues.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/view/model/Signal.h"

namespace smartsurf::run {

class RunHistory final : public view::History {
 public:
  struct Frame {
    scene::Snapshot snapshot;
    std::vector<float> channels;  // of all channels that have values, one after the other
    std::vector<double> metrics;  // in the order of run_signals(); later ones may be missing
  };

  // columns: of the surface. max_bytes: limit of all frames together; at least two are kept.
  explicit RunHistory(int columns, std::size_t max_bytes = std::size_t{384} << 20)
      : columns_(columns), max_bytes_(max_bytes) {}

  // Copies the state of one tick, replacing the oldest one once the limit is reached; allocates until then.
  // channels: the same ones in every tick; the first is the heights, which the snapshot holds. metrics: new
  // ones may follow the earlier ones.
  void add(const scene::Snapshot& snapshot, std::span<const view::Channel> channels,
           std::span<const scene::Metric> metrics);
  void clear();

  std::size_t size() const { return frames_.size(); }
  // 0 is the oldest.
  const Frame& at(std::size_t i) const { return frames_[(oldest_ + i) % frames_.size()]; }
  // The script's metrics at that tick.
  scene::Metrics metrics(const Frame& frame) const;
  // The values of a channel by its index in the channels of add(); empty if it had none.
  std::span<const float> channel(const Frame& frame, std::size_t index) const;

  std::uint64_t begin() const override { return added_ - frames_.size(); }
  std::uint64_t end() const override { return added_; }
  double time_s(std::uint64_t frame) const override { return of(frame).snapshot.time_s; }
  const scene::Snapshot& snapshot(std::uint64_t frame) const override { return of(frame).snapshot; }
  void read(const view::Signal& signal, std::uint64_t first, std::span<double> values) const override;
  std::vector<view::Signal> run_signals() const override;

 private:
  const Frame& of(std::uint64_t frame) const { return at(frame - begin()); }
  double value(const view::Signal& signal, const Frame& frame) const;
  double cell_value(const view::Signal& signal, const Frame& frame) const;

  struct StoredChannel {
    std::string name;
    std::size_t offset = 0, cells = 0;  // in Frame::channels
  };
  int columns_;
  std::size_t max_bytes_, bytes_ = 0;
  std::size_t oldest_ = 0;
  std::uint64_t added_ = 0;
  bool full_ = false;
  std::vector<StoredChannel> channels_;
  std::vector<view::Signal> signals_;  // of Frame::metrics
  std::vector<Frame> frames_;          // a ring buffer once full
};

}  // namespace smartsurf::run
