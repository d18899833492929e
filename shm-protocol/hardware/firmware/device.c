#include "device.h"

#include <string.h>

static uint32_t elements_of(const ssd_device* d, const ssd_channel* c) {
  return (uint32_t)d->hello.rows * d->hello.columns * c->info.components;
}

static uint32_t frame_elements(const ssd_device* d, uint8_t direction) {
  uint32_t sum = 0;
  uint8_t i;
  for (i = 0; i < d->hello.channels; ++i)
    if (d->channels[i].info.direction == direction) sum += elements_of(d, &d->channels[i]);
  return sum;
}

/* A packet that finds no room is not sent: its sequence number goes to the next one. */
static int send(ssd_device* d, uint8_t type, const uint8_t* payload, size_t bytes) {
  uint8_t framed[SSW_MAX_ENCODED + 2];
  ssw_packet packet;
  packet.type = type;
  packet.sequence = d->sequence;
  packet.tick = d->tick;
  packet.payload = payload;
  packet.payload_bytes = bytes;
  if (!d->write(d->context, framed, ssw_write(&packet, framed))) return 0;
  ++d->sequence;
  return 1;
}

/* Convert an element to the wire's byte order and back. Elements may be unaligned, hence memcpy. */
static void to_wire(const void* values, uint32_t index, uint8_t dtype, uint8_t* to) {
  const uint8_t* from = (const uint8_t*)values + (size_t)index * ssw_dtype_bytes(dtype);
  if (dtype == SSW_F32) {
    float value;
    memcpy(&value, from, sizeof value);
    ssw_put_f32(to, value);
  } else if (dtype == SSW_U16) {
    uint16_t value;
    memcpy(&value, from, sizeof value);
    ssw_put_u16(to, value);
  } else {
    *to = *from;
  }
}

static void from_wire(const uint8_t* from, uint8_t dtype, void* values, uint32_t index) {
  uint8_t* to = (uint8_t*)values + (size_t)index * ssw_dtype_bytes(dtype);
  if (dtype == SSW_F32) {
    const float value = ssw_get_f32(from);
    memcpy(to, &value, sizeof value);
  } else if (dtype == SSW_U16) {
    const uint16_t value = ssw_get_u16(from);
    memcpy(to, &value, sizeof value);
  } else {
    *to = *from;
  }
}

/* An element as a raw number, and back: rounded to the nearest. */
static float element(const void* values, uint32_t index, uint8_t dtype) {
  uint8_t wire[4];
  to_wire(values, index, dtype, wire);
  return dtype == SSW_F32 ? ssw_get_f32(wire) : dtype == SSW_U16 ? (float)ssw_get_u16(wire) : (float)*wire;
}

static void put_element(void* values, uint32_t index, uint8_t dtype, float raw) {
  uint8_t wire[4];
  if (dtype == SSW_F32)
    ssw_put_f32(wire, raw);
  else
    ssw_put_u32(wire, raw > 0.0f ? (uint32_t)(raw + 0.5f) : 0u);
  from_wire(wire, dtype, values, index);
}

/* ---- actuators ---- */

/* Without floating point, because interrupts call it. */
static void set_safe_values(ssd_device* d) {
  uint8_t i;
  uint32_t e;
  for (i = 0; i < d->hello.channels; ++i) {
    ssd_channel* c = &d->channels[i];
    const size_t size = ssw_dtype_bytes(c->info.dtype);
    uint8_t* to = (uint8_t*)c->values;
    if (c->info.direction != SSW_ACTUATOR) continue;
    for (e = 0; e < elements_of(d, c); ++e) memcpy(to + (size_t)e * size, d->state[i].safe, size);
  }
}

static void apply_safe_values(ssd_device* d) {
  uint8_t i;
  uint32_t e;
  set_safe_values(d);
  for (i = 0; i < d->hello.channels; ++i) {
    const ssd_channel* c = &d->channels[i];
    ssd_motion* motion = d->state[i].motion;
    if (!motion) continue;
    for (e = 0; e < elements_of(d, c); ++e) {
      motion[e].at = motion[e].target = element(c->values, e, c->info.dtype);
      motion[e].speed = 0.0f;
      motion[e].turn = 0;
    }
  }
  d->in_force = SSW_NONE;
  d->ready_tick = SSW_NONE;
  d->frame_tick = SSW_NONE;
}

/* Completes what an interrupt has begun. */
static void settle(ssd_device* d) {
  if (!d->tripped) return;
  d->tripped = 0;
  apply_safe_values(d);
}

/* The range and the safe value, as raw numbers. A range without any has its lowest neighbour only. */
static void set_range(ssd_state* s, const ssw_channel* c) {
  uint8_t wire[4];
  if (c->dtype == SSW_F32) {
    s->lowest = c->minimum;
    s->highest = c->maximum;
    ssw_put_f32(wire, c->safe);
  } else {
    const ssw_raw_range range = ssw_get_raw_range(c);
    const float most = ssw_most_raw(c->dtype), raw = (c->safe - c->offset) / c->scale + 0.5f;
    s->lowest = range.lowest > most ? most : range.lowest;
    s->highest = range.highest < s->lowest ? s->lowest : range.highest;
    ssw_put_u32(wire, (uint32_t)(raw > s->highest ? s->highest : raw > s->lowest ? raw : s->lowest));
  }
  from_wire(wire, c->dtype, s->safe, 0);
}

/* Brings a received element into the channel's range. */
static void clamp(ssd_device* d, uint8_t channel, uint32_t e) {
  const ssd_channel* c = &d->channels[channel];
  const ssd_state* s = &d->state[channel];
  const float raw = element(c->next, e, c->info.dtype);
  if (raw >= s->lowest && raw <= s->highest) return;
  ++d->clamped;
  if (raw < s->lowest)
    put_element(c->next, e, c->info.dtype, s->lowest);
  else if (raw > s->highest)
    put_element(c->next, e, c->info.dtype, s->highest);
  else /* not a number */
    put_element(c->next, e, c->info.dtype, c->info.safe);
}

/* The chunks of a frame ascend; otherwise the rest of the frame is discarded. */
static void handle_data(ssd_device* d, const ssw_packet* p) {
  uint32_t first, before = 0, count, e;
  const ssd_channel* c;
  size_t size;
  uint8_t channel, i;
  if (p->payload_bytes <= SSW_DATA_HEADER) return;
  channel = p->payload[0];
  if (channel >= d->hello.channels || d->channels[channel].info.direction != SSW_ACTUATOR) return;
  c = &d->channels[channel];
  size = ssw_dtype_bytes(c->info.dtype);
  first = ssw_get_u32(p->payload + 2);
  count = (uint32_t)((p->payload_bytes - SSW_DATA_HEADER) / size);
  if ((p->payload_bytes - SSW_DATA_HEADER) % size != 0 || first > elements_of(d, c) ||
      count > elements_of(d, c) - first)
    return;
  for (i = 0; i < channel; ++i)
    if (d->channels[i].info.direction == SSW_ACTUATOR) before += elements_of(d, &d->channels[i]);
  if (before + first == 0) {
    d->frame_tick = p->tick; /* the first chunk starts a frame and discards a pending one */
    d->frame_elements = 0;
    d->ready_tick = SSW_NONE;
  }
  if (d->frame_tick != p->tick || before + first != d->frame_elements) {
    d->frame_tick = SSW_NONE;
    return;
  }
  for (e = 0; e < count; ++e) {
    from_wire(p->payload + SSW_DATA_HEADER + (size_t)e * size, c->info.dtype, c->next, first + e);
    clamp(d, channel, first + e);
  }
  d->frame_elements += count;
}

static void handle_end(ssd_device* d, const ssw_packet* p) {
  uint32_t all;
  if (p->payload_bytes != SSW_ACTUATOR_END_BYTES) return;
  all = frame_elements(d, SSW_ACTUATOR);
  if (ssw_get_u32(p->payload) == all && (all == 0 || (d->frame_tick == p->tick && d->frame_elements == all)))
    d->ready_tick = p->tick;
  d->frame_tick = SSW_NONE;
}

static void activate_frame(ssd_device* d) {
  uint8_t i;
  uint32_t e;
  for (i = 0; i < d->hello.channels; ++i) {
    ssd_channel* c = &d->channels[i];
    ssd_state* s = &d->state[i];
    if (c->info.direction != SSW_ACTUATOR) continue;
    if (!s->motion) {
      memcpy(c->values, c->next, (size_t)elements_of(d, c) * ssw_dtype_bytes(c->info.dtype));
      continue;
    }
    for (e = 0; e < elements_of(d, c); ++e) s->motion[e].target = element(c->next, e, c->info.dtype);
    if (d->in_force == SSW_NONE &&
        s->limits.soft_start > 0.0f) { /* at most the time that the whole range takes */
      const float step = s->limits.soft_start / c->info.scale * (1e-6f * (float)d->hello.period_us);
      const float periods = (s->highest - s->lowest) / step;
      s->soft_periods = periods < 1e9f ? (uint32_t)periods + 1u : 1000000000u;
    }
  }
  d->in_force = d->ready_tick;
  d->ready_tick = SSW_NONE;
}

/* The way of an element of speed v > 0 that moves now, and then brakes by a in each period: v + (v - a) + …
 */
static float braking_way(float v, float a) {
  const float ratio = v / a, n = ratio < 1e9f ? (float)(uint32_t)ratio : ratio;
  return (n + 1.0f) * (v - 0.5f * a * n);
}

/* The speed of an element in its next period, `distance` away from its target, with acceleration a (0: any).
 */
static float next_speed(float distance, float speed, float fastest, float a) {
  const int back = distance < 0.0f;
  const float d = back ? -distance : distance, v = back ? -speed : speed;
  float next;
  if (a <= 0.0f) {
    next = d < fastest ? d : fastest;
  } else if (d <= a && d <= fastest && d - v <= a && v - d <= a) {
    return distance;
  } else {
    next = v + a < fastest ? v + a : fastest;
    if (next < v - a) next = v - a; /* faster than is allowed now */
    if (next > 0.0f && braking_way(next, a) > d) next = v > 0.0f ? v : 0.0f;
    if (next > 0.0f && braking_way(next, a) > d) next = v - a;
  }
  return back ? -next : next;
}

/* Moves the elements of a channel towards their targets by one period. Returns how many have not arrived. */
static uint32_t move_channel(ssd_device* d, uint8_t channel) {
  const ssd_channel* c = &d->channels[channel];
  ssd_state* s = &d->state[channel];
  const uint32_t count = elements_of(d, c), most = s->limits.most_moving ? s->limits.most_moving : count;
  const float seconds = 1e-6f * (float)d->hello.period_us, scale = c->info.scale;
  const float a = s->limits.acceleration / scale * seconds * seconds;
  float fastest = s->limits.slew > 0.0f ? s->limits.slew / scale * seconds : 3e38f;
  uint32_t moving = 0, away = 0, k, e, first = s->cursor;
  if (s->soft_periods > 0) {
    const float soft = s->limits.soft_start / scale * seconds;
    if (soft < fastest) fastest = soft;
  }
  for (e = 0; e < count; ++e) moving += s->motion[e].turn != 0;
  for (k = 0; k < count; ++k) {
    ssd_motion* m;
    int leaving;
    float before;
    e = first + k < count ? first + k : first + k - count;
    m = &s->motion[e];
    if (m->turn == 0) {
      if (m->at == m->target) continue;
      if (moving >= most) {
        ++away;
        continue;
      }
      ++moving;
      s->cursor = e + 1 < count ? e + 1 : 0;
    }
    leaving = most < count && m->turn >= SSD_TURN;
    before = m->speed;
    if (!leaving) {
      m->speed = next_speed(m->target - m->at, m->speed, fastest, a);
    } else if (a <= 0.0f || (before <= a && before >= -a)) {
      m->speed = 0.0f;
    } else {
      m->speed = before > 0.0f ? before - a : before + a;
    }
    if (!leaving && m->speed == m->target - m->at)
      m->at = m->target;
    else
      m->at += m->speed;
    if (m->at < s->lowest || m->at > s->highest) { /* braking overshot the range by rounding */
      m->at = m->at < s->lowest ? s->lowest : s->highest;
    }
    if (a <= 0.0f && m->at == m->target) m->speed = 0.0f;
    if (m->speed == 0.0f && (leaving || m->at == m->target))
      m->turn = 0;
    else if (m->turn < 255)
      ++m->turn;
    away += m->at != m->target;
    put_element(c->values, e, c->info.dtype, m->at);
  }
  if (s->soft_periods > 0 && (away == 0 || --s->soft_periods == 0)) s->soft_periods = 0;
  return away;
}

/* Moves the actuators that have limits. Returns flags of the sensor frame. */
static uint32_t move_actuators(ssd_device* d) {
  uint32_t flags = 0, away;
  uint8_t i;
  for (i = 0; i < d->hello.channels; ++i) {
    if (!d->state[i].motion) continue;
    if (d->state[i].soft_periods > 0) flags |= SSW_SOFT_START;
    away = move_channel(d, i);
    d->limited += away;
    if (away != 0) flags |= SSW_LIMITED;
  }
  return flags;
}

/* ---- sensors ---- */

static int send_channel(ssd_device* d, uint8_t index) {
  const ssd_channel* c = &d->channels[index];
  const size_t size = ssw_dtype_bytes(c->info.dtype);
  const uint32_t all = elements_of(d, c), most = (uint32_t)(SSW_MAX_DATA / size);
  uint8_t payload[SSW_MAX_PAYLOAD];
  uint32_t first = 0, count, e;
  for (; first < all; first += count) {
    count = all - first < most ? all - first : most;
    payload[0] = index;
    payload[1] = 0;
    ssw_put_u32(payload + 2, first);
    for (e = 0; e < count; ++e)
      to_wire(c->values, first + e, c->info.dtype, payload + SSW_DATA_HEADER + (size_t)e * size);
    if (!send(d, SSW_SENSOR_DATA, payload, SSW_DATA_HEADER + (size_t)count * size)) return 0;
  }
  return 1;
}

static int send_frame(ssd_device* d) {
  uint8_t payload[SSW_SENSOR_END_BYTES], i;
  for (i = 0; i < d->hello.channels; ++i)
    if (d->channels[i].info.direction == SSW_SENSOR && !send_channel(d, i)) return 0;
  ssw_put_u32(payload, frame_elements(d, SSW_SENSOR));
  ssw_put_u32(payload + 4, d->flags);
  ssw_put_u32(payload + 8, d->missed);
  ssw_put_u32(payload + 12, d->in_force);
  return send(d, SSW_SENSOR_END, payload, sizeof payload);
}

static void send_status(ssd_device* d) {
  uint8_t payload[SSW_STATUS_BYTES];
  ssw_status status;
  status.flags = d->flags;
  status.stop_reason = d->stopped ? d->stop_reason : 0;
  status.dropped = d->dropped;
  status.clamped = d->clamped;
  status.limited = d->limited;
  ssw_put_status(&status, payload);
  send(d, SSW_STATUS, payload, sizeof payload);
}

/* ---- description ---- */

static void describe(ssd_device* d) {
  uint8_t payload[SSW_CHANNEL_BYTES], i;
  ssw_put_hello(&d->hello, payload);
  send(d, SSW_HELLO, payload, SSW_HELLO_BYTES);
  for (i = 0; i < d->hello.channels; ++i) {
    ssw_put_channel(&d->channels[i].info, payload);
    send(d, SSW_CHANNEL, payload, SSW_CHANNEL_BYTES);
  }
}

static void send_cells(ssd_device* d, uint8_t kind, size_t size) {
  const uint32_t all = (uint32_t)d->hello.rows * d->hello.columns;
  const uint32_t most = (uint32_t)((SSW_MAX_PAYLOAD - SSW_CELLS_HEADER) / size);
  uint8_t payload[SSW_MAX_PAYLOAD];
  uint32_t first = 0, count, e;
  for (; first < all; first += count) {
    count = all - first < most ? all - first : most;
    ssw_put_u16(payload, (uint16_t)first);
    payload[2] = kind;
    payload[3] = 0;
    for (e = 0; e < count; ++e) {
      uint8_t* to = payload + SSW_CELLS_HEADER + (size_t)e * size;
      uint32_t k;
      if (kind == SSW_MASK)
        *to = d->mask[first + e];
      else
        for (k = 0; k < 3; ++k) ssw_put_f32(to + 4 * k, d->positions[3 * (first + e) + k]);
    }
    send(d, SSW_CELLS, payload, SSW_CELLS_HEADER + (size_t)count * size);
  }
}

static void describe_board(ssd_device* d) {
  uint8_t payload[SSW_CHANNEL2_BYTES], i;
  ssw_channel2 channel;
  d->board.hello = d->hello;
  d->board.hello.version = SSW_VERSION_2;
  d->board.abilities = (d->micros ? SSW_CAN_SYNC : 0u) | (d->mask ? SSW_HAS_MASK : 0u) |
                       (d->positions ? SSW_HAS_POSITIONS : 0u);
  ssw_put_hello2(&d->board, payload);
  send(d, SSW_HELLO2, payload, SSW_HELLO2_BYTES);
  for (i = 0; i < d->hello.channels; ++i) {
    channel.channel = d->channels[i].info;
    channel.limits = d->state[i].limits;
    channel.flags = d->state[i].flags;
    ssw_put_channel2(&channel, payload);
    send(d, SSW_CHANNEL2, payload, SSW_CHANNEL2_BYTES);
  }
  if (d->mask) send_cells(d, SSW_MASK, 1);
  if (d->positions) send_cells(d, SSW_POSITIONS, 12);
}

/* ---- the table's clock ---- */

static void follow(ssd_device* d, const ssw_packet* p) {
  const int32_t most = 10000000; /* 1 % */
  uint8_t payload[SSW_CLOCK_BYTES];
  ssw_sync sync;
  ssw_clock clock;
  if (!d->micros || !ssw_get_sync(p, &sync)) return;
  clock.received = d->micros(d->context);
  d->table_tick_offset = sync.table_tick - d->tick;
  if (sync.correction_us != SSW_KEEP) {
    d->correction_us = sync.correction_us;
    d->rate_ppb = sync.rate_ppb > most ? most : sync.rate_ppb < -most ? -most : sync.rate_ppb;
  }
  clock.t1 = sync.t1;
  clock.tick = d->tick;
  clock.sent = d->micros(d->context);
  clock.into_us = clock.sent - d->period_started;
  ssw_put_clock(&clock, payload);
  send(d, SSW_CLOCK, payload, sizeof payload);
}

/* ---- emergency stop ---- */

static void release_stop(ssd_device* d, const ssw_packet* p) {
  uint32_t reason;
  if (p->payload_bytes != SSW_STOP_NOW_BYTES || !d->stopped) return;
  reason = ssw_get_u32(p->payload);
  if (reason != SSW_NONE && reason != d->stop_reason) return;
  d->stopped = 0;
  apply_safe_values(d); /* the coming frame starts softly */
}

/* ---- public functions ---- */

void ssd_init(ssd_device* d, const ssw_hello* hello, ssd_channel* channels, uint8_t count,
              ssd_try_write write, void* context) {
  uint8_t i;
  memset(d, 0, sizeof *d);
  d->hello = *hello;
  d->hello.version = SSW_VERSION;
  d->hello.channels = count;
  d->channels = channels;
  d->write = write;
  d->context = context;
  d->version = 1;
  d->last_received = 0xFF;
  for (i = 0; i < count; ++i) {
    channels[i].info.index = i;
    set_range(&d->state[i], &channels[i].info);
  }
  ssw_receiver_init(&d->receiver);
  apply_safe_values(d);
}

void ssd_limit(ssd_device* d, uint8_t channel, const ssw_limits* limits, ssd_motion* motion) {
  d->state[channel].limits = *limits;
  d->state[channel].motion = motion;
  apply_safe_values(d);
}

void ssd_receive(ssd_device* d, uint8_t byte) {
  ssw_packet packet;
  uint8_t step = 1;
  if (!ssw_receive(&d->receiver, byte, &packet)) return;
  settle(d);
  if (packet.type != SSW_EDGE) { /* a neighbour's, whose life and sequence say nothing of the host's */
    d->silent = 0;
    d->fed = 1;
    step = (uint8_t)(packet.sequence - d->last_received);
    d->last_received = packet.sequence;
  }
  if (step > 1) d->frame_tick = SSW_NONE; /* a packet was lost: the next chunk may be another frame's */
  switch (packet.type) {
    case SSW_DESCRIBE:
      d->version = 1;
      describe(d);
      break;
    case SSW_DESCRIBE2:
      d->version = 2;
      describe_board(d);
      break;
    case SSW_START:
      d->running = 1;
      break;
    case SSW_STOP:
      d->running = 0;
      apply_safe_values(d);
      break;
    case SSW_ACTUATOR_DATA:
      if (step != 0) handle_data(d, &packet);
      break;
    case SSW_ACTUATOR_END:
      handle_end(d, &packet);
      break;
    case SSW_SYNC:
      follow(d, &packet);
      break;
    case SSW_STOP_NOW:
      if (packet.payload_bytes == SSW_STOP_NOW_BYTES) ssd_stop(d, ssw_get_u32(packet.payload));
      settle(d);
      break;
    case SSW_ARM:
      release_stop(d, &packet);
      break;
    default:
      break; /* a heartbeat, or a packet of a newer version */
  }
}

void ssd_period(ssd_device* d) {
  uint32_t flags = 0;
  if (d->micros) d->period_started = d->micros(d->context);
  if (!d->running) return;
  settle(d);
  if (d->silent < SSD_PATIENCE) ++d->silent;
  if (d->silent >= SSD_PATIENCE) apply_safe_values(d);
  /* A frame for an earlier period is late, but newer than the active one. */
  if (d->has_sent) {
    if (d->ready_tick != d->tick || d->ready_tick == SSW_NONE) { /* no frame answers tick SSW_NONE */
      ++d->missed;
      flags |= SSW_MISSED;
    }
    if (d->ready_tick != SSW_NONE && !d->stopped) activate_frame(d);
  }
  if (d->in_force != SSW_NONE && !d->stopped) flags |= move_actuators(d);
  settle(d); /* an interrupt in the middle of the above */
  if (d->stopped) flags |= SSW_STOPPED;
  if (d->in_force == SSW_NONE) flags |= SSW_SAFE;
  ++d->tick;
  d->has_sent = 1;
  {
    const uint32_t changed = (d->flags ^ flags) & SSW_STOPPED;
    d->flags = flags;
    if (!send_frame(d)) ++d->dropped;
    if (d->version >= 2 && (changed != 0 || d->tick % 16u == 1u)) send_status(d);
  }
}

uint32_t ssd_period_us(ssd_device* d) {
  const int32_t most = (int32_t)(d->hello.period_us / 100u) + 1;
  const int32_t step = d->correction_us > most ? most : d->correction_us < -most ? -most : d->correction_us;
  const int64_t parts = (int64_t)d->hello.period_us * d->rate_ppb + d->remainder;
  const int32_t drift = (int32_t)(parts / 1000000000);
  d->remainder = (int32_t)(parts % 1000000000);
  d->correction_us -= step;
  return (uint32_t)((int32_t)d->hello.period_us + drift + step);
}

uint32_t ssd_table_tick(const ssd_device* d) { return d->tick + d->table_tick_offset; }

int ssd_watchdog(ssd_device* d, uint32_t elapsed_us) {
  const uint32_t patience = SSD_PATIENCE * d->hello.period_us;
  if (d->fed) {
    d->fed = 0;
    d->quiet_us = 0;
    d->expired = 0;
    return 0;
  }
  if (d->expired) return 0;
  d->quiet_us = patience - d->quiet_us > elapsed_us ? d->quiet_us + elapsed_us : patience;
  if (d->quiet_us < patience) return 0;
  d->expired = 1;
  set_safe_values(d);
  d->tripped = 1;
  return 1;
}

void ssd_stop(ssd_device* d, uint32_t reason) {
  if (d->stopped) return;
  d->stop_reason = reason;
  d->stopped = 1;
  set_safe_values(d);
  d->tripped = 1;
}

void ssd_report(ssd_device* d, const char* text) {
  uint8_t payload[2 + 64];
  size_t count = 0;
  ssw_put_u16(payload, SSW_E_HARDWARE);
  while (count < 64 && text[count] != '\0') {
    payload[2 + count] = (uint8_t)text[count];
    ++count;
  }
  send(d, SSW_ERROR, payload, 2 + count);
}
