// All actuators of the surface as one: commands by channel in, the field's motion and forces on the objects
// out.
//
// A command goes through three hands: it is clamped to the channel's range and kept; the cell's faults and
// delays make of it what the cell feels; its model follows that.
//
// Of every physics step: plan(), then forces() where exerts_forces(), then the physics against field(), then
// commit(). The collision sees the cells at their old heights moving at their speed: detecting at the new
// heights as well would count the motion twice.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "common/threads/ThreadPool.h"
#include "smartsurf/surface/FaultMap.h"
#include "smartsurf/surface/actuators/Actuator.h"
#include "smartsurf/surface/actuators/ActuatorFaults.h"

namespace smartsurf::surface {

class ActuatorArray {
 public:
  // All cells at rest at their channels' safe values, the border at its height. `seed` draws the faults.
  // The pool, if any, shares the work on large surfaces, and lives as long as this.
  // Throws scene::InputError for a fault map that does not fit, or an actuator of an unknown model.
  explicit ActuatorArray(const scene::SurfaceSpec&, const FaultMap& = {}, std::uint64_t seed = 1,
                         common::ThreadPool* pool = nullptr);
  ~ActuatorArray();

  Field& field() noexcept { return field_; }
  const Field& field() const noexcept { return field_; }

  std::span<const scene::ActuatorChannel> channels() const noexcept { return channels_; }
  // What was commanded last: rows × columns, row-major, row 0 north, within the channel's range.
  std::span<const float> targets(int channel) const noexcept {
    return commands_[static_cast<std::size_t>(channel)].values;
  }

  // Commands of the cells from `first_cell` on (row-major): the one place that clamps them to the channel's range
  // and replaces a NaN by the channel's safe value. Cells without this channel keep theirs. Returns how many
  // values were replaced.
  std::uint64_t set_targets(int channel, std::span<const float> targets, int first_cell = 0) noexcept;
  void set_target(int channel, int row, int column, float target) noexcept;

  // Once a control period, before its first plan(): the commands are on their way from here.
  void begin_tick() noexcept;

  void plan(double dt_s) noexcept;
  void commit(double dt_s) noexcept;

  bool exerts_forces() const noexcept;
  void add_forces(double dt_s, const BodyView&, std::span<const scene::ObjectSpec> catalogue,
                  std::span<Wrench>) noexcept;

  // rows × columns; empty where every cell is a pin.
  void write_cell_motion(std::vector<scene::ActuatorState>&) const;

 private:
  struct ChannelCommands {
    std::vector<float> values;
    std::vector<CellRun> runs;  // cells that have the channel
    bool dirty = false;         // changed since they were handed on
  };
  // The way of one channel's commands to one model.
  struct CommandRoute {
    Actuator* model = nullptr;
    int model_channel = 0, channel = 0;
    float minimum = 0.0F, maximum = 0.0F;  // of the model
    int latency = 0;                       // of the model, control periods
    std::vector<CellRun> runs;
    bool passthrough = true;                          // commands pass as they are
    std::vector<std::vector<float>> delay_line = {};  // what the cells feel, the last few periods in a ring
    std::size_t head = 0;
    std::vector<float> delayed = {};  // each cell's own period of them; empty where nobody is late
  };

  void init_geometry(const scene::SurfaceSpec&);
  void init_heights(const scene::SurfaceSpec&);
  void add_routes(const scene::SurfaceSpec&, const FaultMap&, std::uint64_t seed);
  void init_targets();
  void apply_faults(CommandRoute&) noexcept;
  void deliver_commands(CommandRoute&) noexcept;

  common::ThreadPool* pool_;
  Field field_;
  float static_max_height_ = 0.0F;  // the highest top that no model moves
  std::vector<scene::ActuatorChannel> channels_;
  std::vector<ChannelCommands> commands_;  // one a channel
  struct Model {
    scene::ActuatorSpec spec;
    std::vector<CellRun> runs;
    std::unique_ptr<Actuator> actuator;
  };
  std::vector<Model> models_;
  std::unique_ptr<ActuatorFaults> faults_;
  std::vector<CommandRoute> routes_;
};

}  // namespace smartsurf::surface
