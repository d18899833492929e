// The contacts and support patches of sleeping bodies, with their impulses: they come back bit for bit when a
// body wakes.
//
// Lists by body lead to the manifolds, so that a body that falls asleep or wakes costs no more than its own
// contacts. Manifolds that were taken out stay as gaps until they are the greater part.
#pragma once

#include <array>
#include <vector>

#include "smartsurf/world/contact/Contact.h"
#include "smartsurf/world/field/SupportPatch.h"

namespace smartsurf::world {

class SleepingContacts {
 public:
  // Copies a manifold of two bodies, or of one that touches what does not move, from another list. `bodies`:
  // their number.
  void add(const ContactList& from, const Manifold&, int bodies);
  // Copies a body's patch, likewise.
  void add(const SupportPatches& from, const SupportPatch&, int bodies);
  // Appends a body's manifolds and its patch to the lists and removes them here.
  void take_out(std::int32_t body, ContactList& pair_contacts, ContactList& static_contacts,
                SupportPatches& supports);
  // Call before the body is removed.
  void on_body_removed(std::int32_t body);

  // Calls visit(other) for the bodies with which a body has a manifold.
  template <class Visit>
  void for_each_neighbour(std::int32_t body, Visit visit) const {
    for_each_manifold_of(body, [&](const Manifold& m) {
      if (m.b >= 0) visit(m.a == body ? m.b : m.a);
    });
  }
  // Calls visit(manifold, contacts) for a body's manifolds with other bodies.
  template <class Visit>
  void for_each_pair_of(std::int32_t body, Visit visit) const {
    for_each_manifold_of(body, [&](const Manifold& m) {
      if (m.b >= 0) visit(m, list_.contacts_of(m));
    });
  }
  // Calls visit(manifold, contacts) in the order in which the manifolds were added: those of pairs, and
  // static ones.
  template <class Visit>
  void for_each_pair(Visit visit) const {
    for_each(list_, true, visit);
  }
  template <class Visit>
  void for_each_static(Visit visit) const {
    for_each(list_, false, visit);
  }
  // Calls visit(patch, samples, sample) for the samples that bear a load.
  template <class Visit>
  void for_each_loaded_sample(Visit visit) const {
    for (const SupportPatch& p : supports_.patches)
      for (Index i = p.first; p.body != kGap && i < p.first + p.count; ++i)
        if (supports_.samples.load[i] > 0.0F) visit(p, supports_.samples, i);
  }
  // Calls visit(manifold, contact) for the contacts of a body.
  template <class Visit>
  void for_each_contact_of(std::int32_t body, Visit visit) {
    for_each_manifold_of(body, [&](const Manifold& m) {
      for (Contact& c : list_.contacts_of(m)) visit(m, c);
    });
  }
  // Calls visit(patch, samples) if the body has a patch.
  template <class Visit>
  void with_patch_of(std::int32_t body, Visit visit) {
    if (body < std::ssize(patch_) && patch_[body] >= 0)
      visit(supports_.patches[patch_[body]], supports_.samples);
  }
  std::size_t contact_count() const { return list_.contacts.size() - contacts_in_gaps_; }

  // The order of the manifolds is state.
  void archive(common::StateArchive& a);

 private:
  static constexpr std::int32_t kGap = -1;  // as Manifold::a and SupportPatch::body

  template <class Visit>
  static void for_each(const ContactList& list, bool pairs, Visit& visit) {
    for (const Manifold& m : list.manifolds)
      if (m.a != kGap && (m.b >= 0) == pairs) visit(m, list.contacts_of(m));
  }
  template <class Visit>
  void for_each_manifold_of(std::int32_t body, Visit visit) const {
    if (body >= std::ssize(first_)) return;
    for (std::int32_t k = first_[body]; k >= 0;) {
      const Manifold& m = list_.manifolds[k];
      const std::int32_t next = next_[k][bodies_[k][0] == body ? 0 : 1];
      if (m.a != kGap) visit(m);
      k = next;
    }
  }
  void index(std::int32_t manifold);
  void close_gaps();
  void close_gaps_of_supports();

  ContactList list_;
  std::size_t contacts_in_gaps_ = 0;
  // By body: its last manifold; by manifold: its bodies, and the one before it of each of them. −1: none.
  std::vector<std::int32_t> first_;
  std::vector<std::array<std::int32_t, 2>> bodies_, next_;
  SupportPatches supports_;
  std::size_t samples_in_gaps_ = 0;
  std::vector<std::int32_t> patch_;  // by body; −1: none
};

}  // namespace smartsurf::world
