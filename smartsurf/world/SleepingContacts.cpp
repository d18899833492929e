#include "smartsurf/world/SleepingContacts.h"

#include <algorithm>
#include <utility>

namespace smartsurf::world {

void SleepingContacts::add(const ContactList& from, const Manifold& m, int bodies) {
  if (std::ssize(first_) < bodies) first_.resize(bodies, -1);
  list_.append(from, m);
  index(static_cast<std::int32_t>(list_.manifolds.size()) - 1);
}

void SleepingContacts::add(const SupportPatches& from, const SupportPatch& p, int bodies) {
  if (std::ssize(patch_) < bodies) patch_.resize(bodies, -1);
  patch_[p.body] = static_cast<std::int32_t>(supports_.patches.size());
  append_patch(from, p, supports_);
}

void SleepingContacts::index(std::int32_t manifold) {
  const Manifold& m = list_.manifolds[manifold];
  bodies_.push_back({m.a, m.b});
  next_.push_back({std::exchange(first_[m.a], manifold), -1});
  if (m.b >= 0) next_.back()[1] = std::exchange(first_[m.b], manifold);
}

void SleepingContacts::take_out(std::int32_t body, ContactList& pair_contacts, ContactList& static_contacts,
                                SupportPatches& supports) {
  if (body < std::ssize(patch_) && patch_[body] >= 0) {
    SupportPatch& p = supports_.patches[std::exchange(patch_[body], -1)];
    append_patch(supports_, p, supports);
    p.body = kGap;
    samples_in_gaps_ += p.count;
    if (2 * samples_in_gaps_ > supports_.samples.size()) close_gaps_of_supports();
  }
  if (body >= std::ssize(first_)) return;
  for (std::int32_t k = std::exchange(first_[body], -1); k >= 0;
       k = next_[k][bodies_[k][0] == body ? 0 : 1]) {
    Manifold& m = list_.manifolds[k];
    if (m.a == kGap) continue;
    auto& contacts = m.b >= 0 ? pair_contacts : static_contacts;
    contacts.append(list_, m);
    m.a = kGap;
    contacts_in_gaps_ += m.count;
  }
  if (2 * contacts_in_gaps_ > list_.contacts.size()) close_gaps();
}

void SleepingContacts::close_gaps() {
  ContactList kept;
  for (const Manifold& m : list_.manifolds)
    if (m.a != kGap) kept.append(list_, m);
  list_ = std::move(kept);
  contacts_in_gaps_ = 0;
  std::ranges::fill(first_, -1);
  bodies_.clear();
  next_.clear();
  for (std::size_t k = 0; k < list_.manifolds.size(); ++k) index(static_cast<std::int32_t>(k));
}

void SleepingContacts::close_gaps_of_supports() {
  SupportPatches kept;
  std::ranges::fill(patch_, -1);
  for (const SupportPatch& p : supports_.patches) {
    if (p.body == kGap) continue;
    patch_[p.body] = static_cast<std::int32_t>(kept.patches.size());
    append_patch(supports_, p, kept);
  }
  supports_ = std::move(kept);
  samples_in_gaps_ = 0;
}

void SleepingContacts::on_body_removed(std::int32_t body) {
  std::erase_if(list_.manifolds, [](const Manifold& m) { return m.a == kGap; });
  remove_body(list_, body);
  if (body < std::ssize(first_)) first_.erase(first_.begin() + body);
  close_gaps();
  remove_body(supports_, body);
  if (body < std::ssize(patch_)) patch_.erase(patch_.begin() + body);
  close_gaps_of_supports();
}

void SleepingContacts::archive(common::StateArchive& a) {
  close_gaps();
  close_gaps_of_supports();
  list_.archive(a);
  supports_.archive(a);
  if (a.saves()) return;
  std::int32_t bodies = 0;
  for (const Manifold& m : list_.manifolds) bodies = std::max({bodies, m.a + 1, m.b + 1});
  first_.assign(bodies, -1);
  patch_.assign(bodies, -1);
  close_gaps();
  close_gaps_of_supports();
}

}  // namespace smartsurf::world
