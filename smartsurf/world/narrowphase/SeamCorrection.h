// Avoids ghost collisions at the seams between adjacent bodies; InternalEdges.h does so within one body.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "smartsurf/world/body/BodyStore.h"
#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/parallel/Team.h"

namespace smartsurf::world {

// Corrects the contacts of bodies that slide or roll over several others which move together: bodies side by
// side at rest, held to each other by joints, or beside a fixed body.
class SeamCorrection {
 public:
  SeamCorrection();
  ~SeamCorrection();
  // The contacts are all those of the step: between bodies that move, and of these with what does not. Called
  // by all members with bodies of their own, which together are all active ones; ends with a barrier.
  void run(const BodyStore&, ContactList& pair_contacts, ContactList& static_contacts,
           std::span<const std::int32_t> own_bodies, const Member&);

 private:
  struct Shared;
  std::unique_ptr<Shared> shared_;
};

}  // namespace smartsurf::world
