// One engine that steps the objects of a workload on its pins: what the benchmark asks of each.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "tests/bench/PinScene.h"

class PinEngine {
 public:
  virtual ~PinEngine() = default;

  // One step of kStep. Heights of all pins at its end, row 0 north.
  virtual void step(const std::vector<float>& heights) = 0;
  // What each pin sees within kSensorRange straight up.
  virtual void sense(const std::vector<float>& heights) = 0;
  virtual Eigen::Vector3d position(std::size_t object) const = 0;
};

// Null: not built in, or not fit for this workload.
std::unique_ptr<PinEngine> make_mujoco_pins(const pin_scene::Workload&);
std::unique_ptr<PinEngine> make_ode_pins(const pin_scene::Workload&);
