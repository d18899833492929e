#include "smartsurf/world/contact/Contact.h"

namespace smartsurf::world {

Vec3 centre_of_load(std::span<const Contact> contacts) {
  float load = 0.0F;
  Vec3 moment = Vec3::Zero();
  for (const Contact& c : contacts)
    load += c.total_normal_impulse, moment += c.total_normal_impulse * c.anchor;
  return load > 0.0F ? Vec3(moment / load) : Vec3::Zero();
}

void remove_body(ContactList& list, std::int32_t body) {
  auto shift_index = [body](std::int32_t& index) {
    if (index > body) --index;
  };
  std::erase_if(list.manifolds, [body](const Manifold& m) { return m.a == body || m.b == body; });
  for (Manifold& m : list.manifolds) shift_index(m.a), shift_index(m.b);
  for (Contact& c : list.contacts) {
    auto index = static_cast<std::int32_t>(c.partner);
    shift_index(index);
    c.partner = c.partner == Partner{body} ? Partner::kRemovedBody : Partner{index};
  }
}

}  // namespace smartsurf::world
