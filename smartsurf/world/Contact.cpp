#include "smartsurf/world/Contact.h"

namespace smartsurf::world {

void forget(ContactList& list, std::int32_t body) {
  auto follow = [body](std::int32_t& index) {
    if (index > body) --index;
  };
  std::erase_if(list.manifolds, [body](const Manifold& m) { return m.a == body || m.b == body; });
  for (Manifold& m : list.manifolds) follow(m.a), follow(m.b);
  for (Contact& c : list.contacts) {
    if (c.other == body) c.other = kGone;
    follow(c.other);
  }
}

}  // namespace smartsurf::world
