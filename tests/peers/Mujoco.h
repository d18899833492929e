// A MuJoCo model built from a description in MJCF, with its state: an engine by other hands to compare with.
#pragma once

#include <mujoco/mujoco.h>

#include <memory>
#include <string>

namespace peers {

class Mujoco {
 public:
  // Throws std::runtime_error with MuJoCo's message where it refuses the description.
  explicit Mujoco(const std::string& mjcf);

  mjModel& model() { return *model_; }
  mjData& data() { return *data_; }
  void step() { mj_step(model_.get(), data_.get()); }

  // Body 0 is the world; the bodies follow in the order of the description.
  const mjtNum* position(int body) const { return data_->xpos + 3 * body; }
  // Of the centre of mass: linear (world frame), then angular (the body's frame). The body must have a free
  // joint.
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
