// The nuisances of an episode: what vary{} and --vary name (docs/experiments.md), drawn from the episode's
// seed and set in its scene.
//
//   friction, rolling_friction, restitution    of all materials, and of objects with a friction of their own
//   mass, size                                 of all objects but fixed ones
//   pin_speed                                  max_speed of all actuators that have one
//   latency, stuck, dead, weak, weak_gain      faults.actuator.…
//   sensor_noise, sensor_dead, …               faults.sensor.…, and those of sensors with one of their own
//   any name of SceneParameter.h               one number for all its objects; not a fault of cells
//
// Objects that come later have them, too, except those of a parameter.
#pragma once

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Variation.h"

namespace smartsurf::simulation {

class Nuisances {
 public:
  // Draws them from the scene's seed, each from a stream of its own, by its name, and sets them in the scene.
  // Throws scene::InputError, one line, for an unknown name or a value that the script could not declare.
  Nuisances(scene::SceneSpec&, std::vector<scene::Variation>);

  const std::vector<scene::Variation>& drawn() const { return drawn_; }

  // The same for an object that the script creates during the episode.
  void apply(const scene::SceneSpec&, scene::ObjectSpec&);

  // Throws as the constructor for any value that could be drawn, and for one that changes a channel.
  static void check(const scene::SceneSpec&, const std::vector<scene::Variation>&);

 private:
  void vary_friction(scene::ObjectSpec&);
  void vary_size_and_mass(const scene::SceneSpec&, scene::ObjectSpec&);
  std::shared_ptr<const scene::Solid> scaled(const std::shared_ptr<const scene::Solid>&, double factor);
  void scale(scene::ObjectSpec&, double factor);

  std::vector<scene::Variation> drawn_;
  std::optional<scene::Variation> mass_, size_, friction_;
  std::vector<std::pair<std::shared_ptr<const scene::Solid>, std::shared_ptr<const scene::Solid>>> scaled_;
};

// True if actuators and sensors of both scenes exchange the same channels, with the same limits.
bool have_same_channels(const scene::SceneSpec&, const scene::SceneSpec&);

}  // namespace smartsurf::simulation
