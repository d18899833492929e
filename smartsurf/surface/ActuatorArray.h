// Drives all actuators of the surface: turns commands per channel into cell motion and forces on objects.
//
// A command is clamped to the channel's range and stored, altered by the cell's faults and latency, and then
// passed to the actuator model that owns the cell. Two channels that lie in a disc are clamped together, when
// both commands of a step are known.
//
// One physics step: plan(), add_forces() if exerts_forces(), the physics step against field(), commit().
// Collision detection sees the cells at their old heights, moving at `speed`; detecting at the new heights
// would count the motion twice.
//
// Not thread-safe. Only the constructor and the functions that write vectors allocate.
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

class SkinShape;

class ActuatorArray {
 public:
  // Starts with every cell at rest at its safe values and the border at its fixed height. `seed`
  // selects the faulty cells. `pool` may be null; otherwise it shares the work on large surfaces and must
  // outlive this object. Throws scene::InputError for an invalid fault map or an unknown actuator model.
  explicit ActuatorArray(const scene::SurfaceSpec&, const FaultMap& = {}, std::uint64_t seed = 1,
                         common::ThreadPool* pool = nullptr);
  ~ActuatorArray();

  Field& field() noexcept { return field_; }
  const Field& field() const noexcept { return field_; }

  std::span<const scene::ActuatorChannel> channels() const noexcept { return channels_; }
  // The latest commands, clamped to the channel's range: rows × columns, row-major, row 0 north, in the
  // channel's unit. Those of a channel that lies in a disc are clamped from the next plan() on.
  std::span<const float> targets(int channel) const noexcept { return commands_[channel].values; }

  // Sets the commands of the cells starting at `first_cell` (row-major). Clamps them to the channel's range
  // and replaces NaN by the cell's safe value; returns the number of values changed that way. Cells
  // without this channel keep their values. Precondition: first_cell + targets.size() ≤ number of cells.
  std::uint64_t set_targets(int channel, std::span<const float> targets, int first_cell = 0) noexcept;
  std::uint64_t set_target(int channel, int row, int column, float target) noexcept;
  // How many of the commands so far were NaN.
  std::uint64_t nan_targets() const noexcept { return nan_targets_; }

  // Call once per control period, before its first plan(): advances the delay lines of delayed commands.
  void begin_tick() noexcept;

  // Writes the velocities of the coming step to the field.
  void plan(double dt_s) noexcept;
  // Moves the cells by those velocities.
  void commit(double dt_s) noexcept;

  // Saves or restores field, commands and models, of an array with the same surface, fault map and seed.
  // Throws common::UserError if a model cannot be saved.
  void archive(common::StateArchive&);

  // True if a model reads Field::impulse.
  bool needs_impulses() const noexcept;
  bool exerts_forces() const noexcept { return exerts_forces_; }
  // Adds the forces of the coming step to the wrenches, one per body. catalogue[id] describes object `id`.
  void add_forces(double dt_s, const BodyView&, std::span<const scene::ObjectSpec> catalogue,
                  std::span<Wrench>) noexcept;

  // The output of a model since the last plan() that the physics must not take.
  std::optional<RefusedOutput> refused_output() const noexcept;

  // Writes the state of the cells' mechanisms for drawing: rows × columns, or empty if every cell is a pin.
  void write_cell_motion(std::vector<scene::ActuatorState>&) const;
  // Writes scene::Snapshot::joint_position.
  void write_joint_positions(std::vector<float>&) const;

 private:
  struct ChannelCommands {
    std::vector<float> values, safe;
    std::vector<CellRun> runs;  // cells that have the channel, ascending
    bool dirty = false;         // changed since the last delivery to the models
    bool in_disc = false;       // clamped by clamp_to_discs()
  };
  // Carries one channel's commands to one model.
  struct CommandRoute {
    Actuator* model = nullptr;
    int model_channel = 0, channel = 0;
    float minimum = 0.0F, maximum = 0.0F;  // range of the model's channel
    float disc_radius = 0.0F;              // of the model's first two channels; 0: none
    int latency = 0;                       // of the model, control periods
    std::vector<CellRun> runs;
    bool passthrough = true;                          // no faults, latency or narrower range
    std::vector<std::vector<float>> delay_line = {};  // ring of effective commands, one frame per period
    std::size_t head = 0;                             // newest frame
    std::vector<float> delayed = {};  // each cell's frame picked by its latency; empty without latency
  };

  void init_geometry(const scene::SurfaceSpec&);
  void init_heights(const scene::SurfaceSpec&);
  void add_routes(const scene::SurfaceSpec&, const FaultMap&, std::uint64_t seed);
  void init_tips();
  void init_targets();
  void clamp_to_discs() noexcept;
  void apply_faults(CommandRoute&) noexcept;
  void deliver_commands(CommandRoute&) noexcept;

  common::ThreadPool* pool_;
  Field field_;
  float static_max_height_ = 0.0F;  // highest cell top at rest
  std::vector<scene::ActuatorChannel> channels_;
  std::vector<ChannelCommands> commands_;  // one per channel
  struct Model {
    scene::ActuatorSpec spec;
    std::vector<CellRun> runs;
    std::unique_ptr<Actuator> actuator;
  };
  std::vector<Model> models_;
  std::uint64_t nan_targets_ = 0;
  bool all_pins_ = true, exerts_forces_ = false, has_joints_ = false;  // all models; any of them
  std::unique_ptr<ActuatorFaults> faults_;
  std::vector<CommandRoute> routes_;
  std::unique_ptr<SkinShape> skin_shape_;  // null without a skin
};

}  // namespace smartsurf::surface
