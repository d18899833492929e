// The registers that the run's APRON program shows: --record-registers, --cells apron:NAME.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "common/process/SharedPlanes.h"
#include "smartsurf/scene/ChannelData.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::run {

class ShownRegisters {
 public:
  // names: to record, separated by commas; the first may be "all". drawn: that of --cells. One may be "".
  ShownRegisters(std::string names, std::string drawn) : names_(std::move(names)), drawn_(std::move(drawn)) {}

  // The value of apron's --show-registers.
  std::string argument() const;
  // The names that are known before the program starts: none of "all".
  std::vector<std::string> expected_names() const;

  // Forgets the values: the program starts again.
  void restart();
  // Takes the values with which the program has answered a frame. Call while it waits for the next one.
  void read(const scene::SurfaceSpec&);
  // None before the first answer; then always the same, in the same order. Valid until restart().
  std::span<const scene::ChannelData> values() const { return channels_; }

 private:
  std::string names_, drawn_;
  common::SharedPlanes planes_;
  std::vector<std::string> shown_names_;
  std::vector<float> values_;
  std::vector<scene::ChannelData> channels_;
};

}  // namespace smartsurf::run
