// Reads a recording: the input of smartsurf info, plot and replay.
//
// Failure: open() throws scene::InputError (one line, beginning with the file's name) if the file is not a
// recording, is truncated before its last flush or lacks a part; reading functions do so if a part cannot be
// decoded. The file is not trusted: the memory allocated at once is bounded by the file's size. A file that a
// run is writing can be read up to its last flush. One thread at a time.
#pragma once

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

class Recording {
 public:
  struct DatasetInfo {
    std::string name;                    // "/objects/position"
    std::vector<std::uint64_t> extents;  // as stored: a killed run's may be longer than frames()
  };

  static Recording open(const std::filesystem::path& path);
  Recording(Recording&&) noexcept;
  Recording& operator=(Recording&&) noexcept;
  ~Recording();

  const std::filesystem::path& path() const;
  std::uint64_t file_bytes() const;

  // The scene as it was when the run began, as far as the recording tells (no sensors; materials by name
  // only; models of actuators that are unknown here stand as pins), except that `objects` holds every object
  // ever created, index = id.
  const scene::SceneSpec& spec() const;
  const RunMetadata& meta() const;
  const std::optional<RunResult>& result() const;  // none when the run did not come to its end
  const std::vector<DatasetInfo>& datasets() const;

  std::size_t frames() const { return ticks().size(); }
  const std::vector<std::uint64_t>& ticks() const;         // one entry a frame, ascending
  const std::vector<double>& times() const;                // seconds, one entry a frame, ascending
  const std::vector<std::uint64_t>& state_hashes() const;  // state hash, one entry a frame

  // The tick before which somebody first touched the run by hand: it cannot be run again.
  std::optional<std::uint64_t> first_interaction_tick() const;

  // What the actuators were told, tick by tick: [0] before the first tick, [t] in the tick that ended as tick
  // t.
  std::size_t input_tick_count() const;  // that are there; 0 in a recording that does not hold them
  // All actuator channels in their order, each rows × columns × components; valid until the next call.
  std::span<const float> read_inputs(std::size_t tick) const;

  bool has_heights() const;
  bool has_motion() const;   // of mechanisms other than pins
  bool has_objects() const;  // false when the experiment recorded no objects: then there are no poses
  // frames [first, first + count) × objects × 3, u; NaN where the object did not exist.
  std::vector<float> read_positions(std::size_t first, std::size_t count) const;
  std::vector<float> read_velocities(std::size_t first, std::size_t count) const;  // likewise, u/s
  const std::vector<std::uint32_t>& contact_counts() const;  // points, one entry a frame
  // Pin heights of a frame, rows × columns, u; valid until the next call. Requires has_heights().
  std::span<const float> read_heights(std::size_t frame) const;
  // One frame as the run saw it. Angular velocities are not recorded and are 0; heights are empty when
  // !has_heights(), and so is motion where none is recorded. Frames one after another are cheaper than in any
  // other order.
  scene::Snapshot read_snapshot(std::size_t frame) const;
  std::vector<std::string> channel_names(const std::string& group) const;  // their names
  // One frame of a channel, rows × columns × components: group "sensors" or "actuators".
  std::vector<float> read_channel(const std::string& group, const std::string& name, std::size_t frame) const;
  // All frames of the channel's first component at one cell.
  std::vector<float> read_cell_history(const std::string& group, const std::string& name, int row,
                                       int column) const;

 private:
  struct Contents;
  explicit Recording(std::unique_ptr<Contents> contents);
  std::unique_ptr<Contents> contents_;
};

// What `smartsurf info` prints: several lines, each ended by '\n'.
std::string describe_recording(const Recording& recording);

}  // namespace smartsurf::record
