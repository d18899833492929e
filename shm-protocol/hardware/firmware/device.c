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

static void send(ssd_device* d, uint8_t type, const uint8_t* payload, size_t bytes) {
  uint8_t framed[SSW_MAX_ENCODED + 2];
  ssw_packet packet;
  packet.type = type;
  packet.sequence = d->sequence++;
  packet.tick = d->tick;
  packet.payload = payload;
  packet.payload_bytes = bytes;
  d->write(d->context, framed, ssw_write(&packet, framed));
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

/* ---- actuators ---- */

static void apply_safe_values(ssd_device* d) {
  uint8_t i, wire[4];
  uint32_t e;
  for (i = 0; i < d->hello.channels; ++i) {
    ssd_channel* c = &d->channels[i];
    if (c->info.direction != SSW_ACTUATOR) continue;
    if (c->info.dtype == SSW_F32) {
      ssw_put_f32(wire, c->info.safe);
    } else {
      const float raw = (c->info.safe - c->info.offset) / c->info.scale + 0.5f;
      ssw_put_u32(wire, raw > 0.0f ? (uint32_t)raw : 0u);
    }
    for (e = 0; e < elements_of(d, c); ++e) from_wire(wire, c->info.dtype, c->values, e);
  }
  d->in_force = SSW_NONE;
  d->ready_tick = SSW_NONE;
  d->frame_tick = SSW_NONE;
}

/* A serial line preserves order: if the chunks of a frame do not arrive in sequence, one was lost and the
 * rest of the frame is discarded. */
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
  for (e = 0; e < count; ++e)
    from_wire(p->payload + SSW_DATA_HEADER + (size_t)e * size, c->info.dtype, c->next, first + e);
  d->frame_elements += count;
}

static void handle_end(ssd_device* d, const ssw_packet* p) {
  if (p->payload_bytes != SSW_ACTUATOR_END_BYTES) return;
  if (d->frame_tick == p->tick && d->frame_elements == frame_elements(d, SSW_ACTUATOR) &&
      ssw_get_u32(p->payload) == d->frame_elements)
    d->ready_tick = p->tick;
  d->frame_tick = SSW_NONE;
}

static void activate_frame(ssd_device* d) {
  uint8_t i;
  for (i = 0; i < d->hello.channels; ++i) {
    ssd_channel* c = &d->channels[i];
    if (c->info.direction == SSW_ACTUATOR)
      memcpy(c->values, c->next, (size_t)elements_of(d, c) * ssw_dtype_bytes(c->info.dtype));
  }
  d->in_force = d->ready_tick;
  d->ready_tick = SSW_NONE;
}

/* ---- sensors ---- */

static void send_channel(ssd_device* d, uint8_t index) {
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
    send(d, SSW_SENSOR_DATA, payload, SSW_DATA_HEADER + (size_t)count * size);
  }
}

static void send_frame(ssd_device* d, uint32_t flags) {
  uint8_t payload[SSW_SENSOR_END_BYTES], i;
  for (i = 0; i < d->hello.channels; ++i)
    if (d->channels[i].info.direction == SSW_SENSOR) send_channel(d, i);
  ssw_put_u32(payload, frame_elements(d, SSW_SENSOR));
  ssw_put_u32(payload + 4, flags);
  ssw_put_u32(payload + 8, d->missed);
  ssw_put_u32(payload + 12, d->in_force);
  send(d, SSW_SENSOR_END, payload, sizeof payload);
}

static void describe(ssd_device* d) {
  uint8_t payload[SSW_CHANNEL_BYTES], i;
  ssw_put_hello(&d->hello, payload);
  send(d, SSW_HELLO, payload, SSW_HELLO_BYTES);
  for (i = 0; i < d->hello.channels; ++i) {
    ssw_put_channel(&d->channels[i].info, payload);
    send(d, SSW_CHANNEL, payload, SSW_CHANNEL_BYTES);
  }
}

/* ---- public functions ---- */

void ssd_init(ssd_device* d, const ssw_hello* hello, ssd_channel* channels, uint8_t count, ssd_write write,
              void* context) {
  uint8_t i;
  memset(d, 0, sizeof *d);
  d->hello = *hello;
  d->hello.version = SSW_VERSION;
  d->hello.channels = count;
  d->channels = channels;
  d->write = write;
  d->context = context;
  for (i = 0; i < count; ++i) channels[i].info.index = i;
  ssw_receiver_init(&d->receiver);
  apply_safe_values(d);
}

void ssd_receive(ssd_device* d, uint8_t byte) {
  ssw_packet packet;
  if (!ssw_receive(&d->receiver, byte, &packet)) return;
  d->silent = 0;
  switch (packet.type) {
    case SSW_DESCRIBE:
      describe(d);
      break;
    case SSW_START:
      d->running = 1;
      break;
    case SSW_STOP:
      d->running = 0;
      apply_safe_values(d);
      break;
    case SSW_ACTUATOR_DATA:
      handle_data(d, &packet);
      break;
    case SSW_ACTUATOR_END:
      handle_end(d, &packet);
      break;
    default:
      break; /* a heartbeat, or a packet of a newer version */
  }
}

void ssd_period(ssd_device* d) {
  uint32_t flags = 0;
  if (!d->running) return;
  if (d->silent < SSD_PATIENCE) ++d->silent;
  if (d->silent >= SSD_PATIENCE) apply_safe_values(d);
  /* A frame for an earlier period is late, but newer than the active one. */
  if (d->tick != 0) {
    if (d->ready_tick != d->tick) {
      ++d->missed;
      flags |= SSW_MISSED;
    }
    if (d->ready_tick != SSW_NONE) activate_frame(d);
  }
  if (d->in_force == SSW_NONE) flags |= SSW_SAFE;
  ++d->tick;
  send_frame(d, flags);
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
