// A quantity over time, and the stored frames that its values come from. No OpenGL.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "smartsurf/view/model/FrameInput.h"
#include "smartsurf/view/model/SceneItem.h"

namespace smartsurf::view {

struct Signal {
  enum class Kind { kObject, kCell, kRun, kMetric };
  Kind kind = Kind::kRun;
  // kObject: one of kObjectQuantities. kCell: a channel's name. kRun: one of kRunQuantities. kMetric: the
  // name that the script passes to metric().
  std::string quantity;
  scene::ObjectId object = 0;  // kObject
  int row = 0, column = 0;     // kCell; from 0, row 0 north
  bool operator==(const Signal&) const = default;
};

inline constexpr std::array kObjectQuantities = {"x", "y", "z", "speed", "spin"};
inline constexpr std::array kRunQuantities = {"contacts", "objects"};

// The notation of `smartsurf plot --what`: "speed:ID", "CHANNEL:ROW,COLUMN", "contacts", "metric:NAME". A
// name alone that is not among kRunQuantities also names a metric.
std::string to_string(const Signal& signal);
// Empty if the text has none of these forms.
std::optional<Signal> parse_signal(std::string_view text);
// channels: those of the surface. "": dimensionless.
std::string unit_of(const Signal& signal, std::span<const Channel> channels);
// All signals of an object or a cell.
std::vector<Signal> signals_of(const SceneItem& item, std::span<const Channel> channels);
// The value of a kObject signal; NaN if the object is not in the snapshot.
double object_value(const Signal& signal, const scene::Snapshot& snapshot);

// The stored frames of a run or a recording, numbered from the run's first frame. Old frames may be dropped.
class History {
 public:
  virtual ~History() = default;
  virtual std::uint64_t begin() const = 0;  // the oldest frame
  virtual std::uint64_t end() const = 0;    // one past the latest
  virtual double time_s(std::uint64_t frame) const = 0;
  // Valid until the next call.
  virtual const scene::Snapshot& snapshot(std::uint64_t frame) const = 0;
  // Writes the signal's values in the frames [first, first + values.size()); NaN where it has none.
  virtual void read(const Signal& signal, std::uint64_t first, std::span<double> values) const = 0;
  // The kRun and kMetric signals that have values.
  virtual std::vector<Signal> run_signals() const = 0;

  // The first frame at or after the time; end() if there is none.
  std::uint64_t frame_at(double time_s) const;
};

}  // namespace smartsurf::view
