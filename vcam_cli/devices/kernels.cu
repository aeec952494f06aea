// Formulas of counter_noise.py, and cosine transforms by one real Fourier transform (Makhoul 1980),
// for a graphics processor. REAL is float or double. A test compiles the functions for a processor.

typedef unsigned int u32;
typedef unsigned long long u64;
typedef long long i64;

#ifndef HOST
#define FUNCTION __device__ __forceinline__
#define KERNEL extern "C" __global__ void
#define EACH(i, n) \
  for (i64 i = blockIdx.x * (i64)blockDim.x + threadIdx.x; i < (n); i += (i64)gridDim.x * blockDim.x)
#endif

FUNCTION void philox(u64 key, u32 block, u32 sample, u32 low, u32 high, u32* out) {
  u32 a = block, b = sample, c = low, d = high, first = (u32)key, second = (u32)(key >> 32);
  for (int i = 0; i < 10; ++i) {
    u64 m = 0xD2511F53ull * a, n = 0xCD9E8D57ull * c;
    a = (u32)(n >> 32) ^ b ^ first;
    c = (u32)(m >> 32) ^ d ^ second;
    b = (u32)n;
    d = (u32)m;
    first += 0x9E3779B9u;
    second += 0xBB67AE85u;
  }
  out[0] = a;
  out[1] = b;
  out[2] = c;
  out[3] = d;
}

FUNCTION float normal(u32 word) {
  u32 place = word & 0x7FFFFFFFu;
  float p = ((float)place + 0.5f) * 2.3283064365386963e-10f;
  float x = ((float)(0x7FFFFFFFu - place) + 0.5f) * 4.656612873077393e-10f;
  float w = -logf(4.0f * p * (1.0f - p)), z;
  if (w < 5.0f) {
    float u = w - 2.5f;
    z = 3.9583209598959e-08f;
    z = z * u + 4.851791004512052e-07f;
    z = z * u + -4.981194706488168e-06f;
    z = z * u + -6.207880232977914e-06f;
    z = z * u + 0.00030911510111764073f;
    z = z * u + -0.001773041789419949f;
    z = z * u + -0.00590812973678112f;
    z = z * u + 0.34880268573760986f;
    z = z * u + 2.1233136653900146f;
  } else {
    float u = sqrtf(w) - 3.5f;
    z = -0.00024882846628315747f;
    z = z * u + 0.0007895552553236485f;
    z = z * u + -0.001076356042176485f;
    z = z * u + 0.0014297561720013618f;
    z = z * u + -0.0028612962923943996f;
    z = z * u + 0.004660701844841242f;
    z = z * u + 1.4246275424957275f;
    z = z * u + 4.717088222503662f;
  }
  z *= x;
  return word >> 31 ? z : -z;
}

FUNCTION double uniform(u32 word) {
  double p = ((double)(word & 0x7FFFFFFFu) + 0.5) * 2.3283064365386963e-10;
  return word >> 31 ? p : 1 - p;
}

FUNCTION REAL poisson_number(REAL mean, u32 word) {
  if (mean < (REAL)8) {
    double m = mean > (REAL)0 ? (double)mean : 0.0, upper = uniform(word);
    double term = exp(-m), tail = -expm1(-m);
    int k = 0;
    while (tail > upper && k < 200) {
      k += 1;
      term = term * (m / k);
      tail = tail - term;
    }
    return (REAL)k;
  }
  REAL z = (REAL)normal(word), root = sqrt(mean), square = z * z;
  REAL out = (square * (REAL)(-1.0 / 72) - (REAL)(1.0 / 36)) * z / root + square * (REAL)(1.0 / 6);
  out = floor(out + root * z + mean + (REAL)(1.0 / 3));
  return out > (REAL)0 ? out : (REAL)0;
}

// Numbers of all pixels of all frames: out (batch, count), keys (batch).
KERNEL normals(REAL* out, const u64* keys, u32 low, u32 high, u32 sample, i64 count, i64 batch) {
  i64 groups = (count + 3) / 4;
  EACH(i, groups * batch) {
    i64 frame = i / groups, group = i - frame * groups;
    u32 word[4];
    philox(keys[frame], (u32)group, sample, low, high, word);
    for (int j = 0; j < 4 && 4 * group + j < count; ++j)
      out[frame * count + 4 * group + j] = (REAL)normal(word[j]);
  }
}

// Normal numbers times rms are added to values (batch, count).
KERNEL add_normals(REAL* values, const u64* keys, u32 low, u32 high, u32 sample, i64 count,
                   i64 batch, double rms) {
  i64 groups = (count + 3) / 4;
  REAL factor = (REAL)rms;
  EACH(i, groups * batch) {
    i64 frame = i / groups, group = i - frame * groups;
    u32 word[4];
    philox(keys[frame], (u32)group, sample, low, high, word);
    for (int j = 0; j < 4 && 4 * group + j < count; ++j)
      values[frame * count + 4 * group + j] += (REAL)normal(word[j]) * factor;
  }
}

KERNEL uniforms(double* out, const u64* keys, u32 low, u32 high, u32 sample, i64 count, i64 batch) {
  i64 groups = (count + 3) / 4;
  EACH(i, groups * batch) {
    i64 frame = i / groups, group = i - frame * groups;
    u32 word[4];
    philox(keys[frame], (u32)group, sample, low, high, word);
    for (int j = 0; j < 4 && 4 * group + j < count; ++j)
      out[frame * count + 4 * group + j] = uniform(word[j]);
  }
}

// Poisson numbers take the place of their means.
KERNEL poisson(REAL* mean, const u64* keys, u32 low, u32 high, u32 sample, i64 count, i64 batch) {
  i64 groups = (count + 3) / 4;
  EACH(i, groups * batch) {
    i64 frame = i / groups, group = i - frame * groups;
    u32 word[4];
    philox(keys[frame], (u32)group, sample, low, high, word);
    for (int j = 0; j < 4 && 4 * group + j < count; ++j) {
      i64 at = frame * count + 4 * group + j;
      mean[at] = poisson_number(mean[at], word[j]);
    }
  }
}

// A line and its ends: out = clip(min(values, most) scale + offset, 0, highest), whole for codes.
FUNCTION REAL on_line(REAL value, REAL most, REAL scale, REAL offset, REAL highest) {
  REAL level = (value < most ? value : most) * scale + offset;
  return level < (REAL)0 ? (REAL)0 : level > highest ? highest : level;
}

KERNEL levels(const REAL* values, REAL* out, double most, double scale, double offset,
              double highest, i64 count) {
  EACH(i, count)
    out[i] = on_line(values[i], (REAL)most, (REAL)scale, (REAL)offset, (REAL)highest);
}

KERNEL codes16(const REAL* values, unsigned short* out, double most, double scale, double offset,
               double highest, i64 count) {
  EACH(i, count)
    out[i] = (unsigned short)rint(
        on_line(values[i], (REAL)most, (REAL)scale, (REAL)offset, (REAL)highest));
}

KERNEL codes32(const REAL* values, u32* out, double most, double scale, double offset,
               double highest, i64 count) {
  EACH(i, count)
    out[i] =
        (u32)rint(on_line(values[i], (REAL)most, (REAL)scale, (REAL)offset, (REAL)highest));
}

// A DCT-II of real x is one Fourier transform of its even samples and then its odd ones backwards.
FUNCTION i64 before(i64 place, i64 count) {
  return 2 * place < count ? 2 * place : 2 * (count - 1 - place) + 1;
}

FUNCTION i64 behind(i64 index, i64 count) {
  return index % 2 ? count - 1 - index / 2 : index / 2;
}

// Mixtures of the channels of pictures, in the order of the transform.
// pictures (n, height, width, channels) -> out (n, mixtures, rows, columns); the picture lies
// `down` and `across` inside black samples.
KERNEL mixed(const REAL* pictures, const REAL* mix, REAL* out, i64 n, int channels, int mixtures,
             i64 height, i64 width, i64 rows, i64 columns, i64 down, i64 across, int ordered) {
  EACH(i, n * rows * columns) {
    i64 column = i % columns, row = i / columns % rows, frame = i / columns / rows;
    i64 y = (ordered ? before(row, rows) : row) - down;
    i64 x = (ordered ? before(column, columns) : column) - across;
    bool inside = y >= 0 && y < height && x >= 0 && x < width;
    const REAL* sample = pictures + ((frame * height + y) * width + x) * channels;
    for (int m = 0; m < mixtures; ++m) {
      REAL sum = 0;
      if (inside)
        for (int k = 0; k < channels; ++k) sum += mix[m * channels + k] * sample[k];
      out[((frame * mixtures + m) * rows + row) * columns + column] = sum;
    }
  }
}

// The DCT-II coefficients of ordered planes from their half spectrum (rows, columns / 2 + 1, 2):
// y = 2 Re(a (b V[k, l] + conj(b) V[k, -l])), a = exp(-i pi k / 2 rows), b likewise of l.
FUNCTION REAL cosine_term(const REAL* v, const REAL* turn_y, const REAL* turn_x, i64 k, i64 l,
                          i64 rows, i64 columns) {
  i64 half = columns / 2 + 1, opposite = k ? rows - k : 0, q = l < half ? l : columns - l;
  const REAL *direct = v + 2 * (k * half + q), *other = v + 2 * (opposite * half + q);
  REAL ar = turn_y[2 * k], ai = turn_y[2 * k + 1], br = turn_x[2 * l], bi = turn_x[2 * l + 1];
  // V[k, l] and V[k, -l], of which one is the conjugate of V[-k, q].
  REAL pr, pi, qr, qi;
  if (l < half) {
    pr = direct[0], pi = direct[1], qr = other[0], qi = -other[1];
  } else {
    pr = other[0], pi = -other[1], qr = direct[0], qi = direct[1];
  }
  REAL sr = br * pr - bi * pi + br * qr + bi * qi;
  REAL si = br * pi + bi * pr + br * qi - bi * qr;
  return 2 * (ar * sr - ai * si);
}

KERNEL cosines(const REAL* v, const REAL* turn_y, const REAL* turn_x, REAL* out, i64 planes,
               i64 rows, i64 columns) {
  EACH(i, planes * rows * columns) {
    i64 l = i % columns, k = i / columns % rows, plane = i / columns / rows;
    const REAL* spectrum = v + plane * rows * (columns / 2 + 1) * 2;
    out[i] = cosine_term(spectrum, turn_y, turn_x, k, l, rows, columns);
  }
}

// Terms filtered and summed over the mixtures: out[c, y, x] = sum_m spectrum[m, from y, from x] t[m, c, y, x].
KERNEL filtered(const REAL* spectrum, const REAL* transfer, const int* from_y, const int* from_x,
                REAL* out, i64 n, int mixtures, int colors, i64 terms_y, i64 terms_x, i64 rows,
                i64 columns) {
  EACH(i, n * terms_y * terms_x) {
    i64 x = i % terms_x, y = i / terms_x % terms_y, frame = i / terms_x / terms_y;
    const REAL* at = spectrum + (frame * mixtures * rows + from_y[y]) * columns + from_x[x];
    for (int c = 0; c < colors; ++c) {
      REAL sum = 0;
      for (int m = 0; m < mixtures; ++m)
        sum += at[m * rows * columns] *
               transfer[((i64)(m * colors + c) * terms_y + y) * terms_x + x];
      out[((frame * colors + c) * terms_y + y) * terms_x + x] = sum;
    }
  }
}

// The half spectrum of the ordered DCT-III of planes; only the first terms of `from` are not 0:
// V[k, l] = conj(a b) ((y[k, l] - y[-k, -l]) - i (y[-k, l] + y[k, -l])), y[rows - 0] = 0.
KERNEL half_spectrum(const REAL* from, const REAL* turn_y, const REAL* turn_x, REAL* out,
                     i64 planes, i64 rows, i64 columns, i64 terms_y, i64 terms_x) {
  i64 half = columns / 2 + 1;
  EACH(i, planes * rows * half) {
    i64 l = i % half, k = i / half % rows, plane = i / half / rows;
    const REAL* y = from + plane * terms_y * terms_x;
    i64 m = rows - k, n = columns - l;
    bool ky = k < terms_y, lx = l < terms_x, my = m < terms_y, nx = n < terms_x;
    REAL direct = ky && lx ? y[k * terms_x + l] : 0, both = my && nx ? y[m * terms_x + n] : 0;
    REAL down = my && lx ? y[m * terms_x + l] : 0, along = ky && nx ? y[k * terms_x + n] : 0;
    REAL re = direct - both, im = -(down + along);
    REAL ar = turn_y[2 * k], ai = turn_y[2 * k + 1], br = turn_x[2 * l], bi = turn_x[2 * l + 1];
    REAL tr = ar * br - ai * bi, ti = -(ar * bi + ai * br);
    out[2 * i] = tr * re - ti * im;
    out[2 * i + 1] = tr * im + ti * re;
  }
}

// Planes in their own order; of a mosaic each place has the plane of its color, and no less than 0.
// from (n, colors, rows, columns) ordered -> out (n, height, width) or (n, colors, height, width).
KERNEL placed(const REAL* from, const int* color, REAL* out, i64 n, int colors, i64 rows,
              i64 columns, i64 top, i64 left, i64 height, i64 width) {
  EACH(i, n * height * width) {
    i64 x = i % width, y = i / width % height, frame = i / width / height;
    i64 at = behind(top + y, rows) * columns + behind(left + x, columns), size = rows * columns;
    if (color) {
      REAL value = from[(frame * colors + color[y * width + x]) * size + at];
      out[i] = value > (REAL)0 ? value : (REAL)0;
    } else {
      for (int c = 0; c < colors; ++c)
        out[((frame * colors + c) * height + y) * width + x] = from[(frame * colors + c) * size + at];
    }
  }
}
