// Reads a recording: the input of smartsurf info, plot and replay.
//
// Failure: open() throws scene::InputError (one line, starting with the file's name) if the file is not a
// recording, is truncated before its last flush or lacks a required part; the read functions throw it if data
// cannot be decoded. The file is untrusted: no single allocation exceeds what the file's size justifies.
// A file that a run is still writing can be read up to its last flush. One thread at a time.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "smartsurf/record/Recorder.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Snapshot.h"

namespace smartsurf::record {

// The groups of a recording that hold channels of cells.
enum class ChannelGroup { kSensors, kActuators, kRegisters };
inline constexpr std::array kChannelGroups = {ChannelGroup::kSensors, ChannelGroup::kActuators,
                                              ChannelGroup::kRegisters};
std::string to_string(ChannelGroup);  // its name in the file

// Address space for reading the file: HDF5 1.10 allocates the length that a text has by its reference, up to
// 4 GiB, before it looks for the text.
std::size_t memory_to_read(const std::filesystem::path& path);
// Processor time to read, draw or convert the file: well above what any recording of its size needs.
double time_to_read_s(const std::filesystem::path& path);

// Says why a recording without has_objects() has none.
std::string why_no_objects(const RunMetadata& meta);

class Recording {
 public:
  struct ChannelInfo {
    std::string unit;                                        // "": dimensionless, or unknown
    double minimum = 0.0, maximum = 0.0;                     // of the values; equal: unknown
    std::optional<std::array<double, 3>> origin, direction;  // as of scene::SensorChannel
  };
  struct DatasetInfo {
    std::string name;                    // "/objects/position"
    std::vector<std::uint64_t> extents;  // as stored; may exceed frames() if the run was killed
  };

  static Recording open(const std::filesystem::path& path);
  // The same without the child: for processes that may crash.
  static Recording open_here(const std::filesystem::path& path);
  Recording(Recording&&) noexcept;
  Recording& operator=(Recording&&) noexcept;
  ~Recording();

  const std::filesystem::path& path() const;
  std::uint64_t file_bytes() const;

  // The scene at the start of the run, with these differences: `objects` holds every object ever created,
  // index = id; there are no sensors; materials have only a name; actuators of an unknown model become pins.
  const scene::SceneSpec& spec() const;
  const RunMetadata& meta() const;
  const std::string& actuator_models() const;      // as recorded: "pin, wheels"
  const std::optional<RunResult>& result() const;  // nullopt if the run did not finish
  const std::vector<DatasetInfo>& datasets() const;

  std::size_t frames() const { return ticks().size(); }
  const std::vector<std::uint64_t>& ticks() const;         // one per frame, ascending
  const std::vector<double>& times() const;                // s, one per frame, ascending
  const std::vector<std::uint64_t>& state_hashes() const;  // one per frame

  // The tick after which the user first intervened; such a run cannot be reproduced.
  std::optional<std::uint64_t> first_interaction_tick() const;

  // Number of ticks with recorded actuator targets; 0 if the recording has none.
  std::size_t input_tick_count() const;
  // The actuator targets of one tick: all actuator channels in order, each rows × columns × components. Index
  // 0 holds the targets before the first tick, index t those of the tick that ended as tick t. Valid until
  // the next call.
  std::span<const float> read_inputs(std::size_t tick) const;

  bool has_heights() const;
  bool has_motion() const;              // false if all actuators are pins
  bool has_angular_velocities() const;  // false for recordings of older versions, which lack the dataset
  bool has_objects() const;  // false if the experiment did not record objects; there are then no poses
  // Throws scene::InputError if there is nothing to show: no frame, or neither objects nor heights.
  void require_poses() const;
  // Frames [first, first + count) × objects × 3, u; NaN where the object did not exist.
  std::vector<float> read_positions(std::size_t first, std::size_t count) const;
  std::vector<float> read_velocities(std::size_t first, std::size_t count) const;  // u/s
  // rad/s, in the world frame. Requires has_angular_velocities().
  std::vector<float> read_angular_velocities(std::size_t first, std::size_t count) const;
  const std::vector<std::uint32_t>& contact_counts() const;  // contact points, one per frame
  // Pin heights of a frame, rows × columns, u; valid until the next call. Requires has_heights().
  std::span<const float> read_heights(std::size_t frame) const;
  // One frame. Angular velocities are NaN if !has_angular_velocities(); all pins are down if !has_heights();
  // actuator states are empty if !has_motion(), the skin's heights without one. Reading frames in ascending
  // order is the cheapest.
  scene::Snapshot read_snapshot(std::size_t frame) const;
  std::vector<std::string> channel_names(ChannelGroup group) const;
  // One frame of a channel, rows × columns × components, row-major.
  std::vector<float> read_channel(ChannelGroup group, const std::string& name, std::size_t frame) const;
  // Unknown in recordings of older versions.
  ChannelInfo channel_info(ChannelGroup group, const std::string& name) const;
  // How many numbers a cell of the channel has.
  std::size_t channel_components(ChannelGroup group, const std::string& name) const;
  // The channel at one cell: frames × components.
  std::vector<float> read_cell_history(ChannelGroup group, const std::string& name, int row,
                                       int column) const;
  std::vector<std::string> metric_names() const;
  // One value per frame; NaN before the script first set it.
  std::vector<double> read_metric(const std::string& name) const;
  // Tells if the experiment's goal was reached, and when first; nullopt if it has no goal or the run did not
  // finish.
  std::optional<bool> success() const;
  std::optional<double> success_s() const;

 private:
  struct Contents;
  explicit Recording(std::unique_ptr<Contents> contents);
  std::unique_ptr<Contents> contents_;
};

// The output of `smartsurf info`: several lines, each ending with '\n'. Leaves out what does not apply, such
// as the success of an experiment without a goal.
std::string describe_recording(const Recording& recording);
// The output of `smartsurf info --datasets`: one line per dataset, its name and extents.
std::string list_datasets(const Recording& recording);

}  // namespace smartsurf::record
