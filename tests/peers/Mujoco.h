// A MuJoCo model built from MJCF, with its state: an independent engine for comparison. Compiles with the
// newest wheel and with Debian's 2.2.
#pragma once

#include <mujoco/mujoco.h>

#include <memory>
#include <string>

namespace peers {

class Mujoco {
 public:
  // Throws std::runtime_error with MuJoCo's message if the MJCF is invalid.
  explicit Mujoco(const std::string& mjcf);

  mjModel& model() { return *model_; }
  mjData& data() { return *data_; }
  void step() { mj_step(model_.get(), data_.get()); }

  // World coordinates. Body 0 is the world; the others follow in MJCF order.
  const mjtNum* position(int body) const { return data_->xpos + 3 * body; }
  // Velocity of the centre of mass: 3 linear (world frame), then 3 angular (body frame) components. The body
  // must have a free joint.
  mjtNum* velocity(int body) { return data_->qvel + model_->body_dofadr[body]; }

 private:
  struct Delete {
    void operator()(mjModel* m) const { mj_deleteModel(m); }
    void operator()(mjData* d) const { mj_deleteData(d); }
  };
  std::unique_ptr<mjModel, Delete> model_;
  std::unique_ptr<mjData, Delete> data_;
};

}  // namespace peers
