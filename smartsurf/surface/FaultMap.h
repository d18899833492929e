// A table of faults of individual cells, read from CSV (docs/actuators.md):
//
//   row,column,channel,fault,value
//   0,12,height,stuck,3.5
//
// Rows and columns count from 0, row 0 north, column 0 west. An empty channel applies to every channel of the
// cell; `value` is empty for faults without one. Empty lines and lines starting with # are skipped. Actuators
// and sensors share the table, each using the entries of its own channels.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::surface {

// The faults that an entry may name.
inline const std::vector<std::string> kActuatorFaults{"stuck", "dead", "weak", "late", "gain", "offset"};
inline const std::vector<std::string> kSensorFaults{"dead",       "stuck", "stuck_low",
                                                    "stuck_high", "gain",  "offset"};

// An actuator has this fault only by an entry that names its channel; without one it is that of sensors.
inline bool needs_actuator_channel(std::string_view fault) { return fault == "gain" || fault == "offset"; }

struct FaultEntry {
  int row = 0, column = 0;
  std::string channel;  // "": every channel
  std::string fault;
  std::optional<double> value;  // finite
  int line = 0;                 // in the file, from 1
};

class FaultMap {
 public:
  FaultMap() = default;  // no entries
  // Throws scene::InputError "FILE:LINE: …" unless the file is a valid table for a surface of this size.
  FaultMap(const scene::FaultMapFile&, int rows, int columns);
  // The entries of the table, if there is one, then those of single cells.
  FaultMap(const scene::FaultSpec&, int rows, int columns);

  std::span<const FaultEntry> entries() const noexcept { return entries_; }

  // Throws scene::InputError if an entry names a channel that is not in `known`.
  void require_channels(const std::vector<std::string>& known) const;
  // Throws scene::InputError with the message "FILE:LINE: clause".
  [[noreturn]] void refuse(const FaultEntry&, const std::string& clause) const;
  // Refuses a fault that is not in `known`, the faults of `owner`, such as "a sensor".
  [[noreturn]] void refuse_fault(const FaultEntry&, const std::string& owner,
                                 const std::vector<std::string>& known) const;

 private:
  std::string name_;
  std::vector<FaultEntry> entries_;
};

}  // namespace smartsurf::surface
