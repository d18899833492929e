#include "smartsurf/surface/ObjectType.h"

namespace smartsurf::surface {

void ObjectType::sense(const Moment& moment, WorkerPool& pool) {
  for (std::size_t id = type_of_object_.size(); id < moment.catalogue.size(); ++id) {
    const auto next = static_cast<float>(type_of_label_.size() + 1);
    type_of_object_.push_back(type_of_label_.try_emplace(moment.catalogue[id].label, next).first->second);
  }
  marks_.resize(moment.bodies.size());
  for (std::size_t k = 0; k < marks_.size(); ++k) marks_[k] = type_of_object_[moment.bodies[k].id];
  first_.sweep(moment.bodies, marks_, 0.0F, moment.snapshot.height, pool);
}

}  // namespace smartsurf::surface
