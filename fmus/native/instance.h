/* Instance of a component: state machine, kernels, messages, variables, saved states; the same for all kinds of
   components and both versions of FMI. Included once, by fmi2.c or fmi3.c; model.h holds the component's data.

   Behaviour and messages are those of fmus/fmi/slave.py. No threads, no global variables. Before the inclusion there is the
   type Host, the callbacks of a tool; after it, log_message, which writes to it. */
#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined _WIN32 /* its headers have names of model.h, so they come first */
#include <malloc.h>
#include <windows.h>
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { STATUS_OK, STATUS_WARNING, STATUS_DISCARD, STATUS_ERROR }; /* as fmi2Status and fmi3Status */
typedef int Status;

typedef struct { const char *text, *const *names; } Sentence;
typedef struct { int free; double least, most; const char *text; } Range; /* of a Real parameter */
typedef struct { int free, count, first; const char *const *names; } Choice; /* of a String parameter; first: as an Enumeration, 0: none */
typedef struct { int place, count; } Index; /* of an array, in the state */
#include "model.h"

static const char *const CATEGORY[] = { "", "logStatusWarning", "logStatusDiscard", "logStatusError" }; /* by status */
enum { WARNED = 1, FAILED = 3 }; /* of the output status */
enum { OF_SHAPE = 28 }; /* characters of a guid */
enum { LONGEST = 1500, FIRST_LINK = N_INPUT + N_OUTPUT, FIRST_PARAMETER = FIRST_LINK + N_LINK };

/* numba's calling convention: the result goes to the first pointer, the exception to the second */
struct raised;
#define BLOCKS double *x, int64_t *n, double *f, int64_t *k, char *z, const double *p, const int64_t *c
#define OF(i) (i)->d.state, (i)->d.counter, (i)->f, (i)->k, (i)->z, (i)->d.value + FIRST_PARAMETER, (i)->d.choice
typedef int Start(int64_t *, struct raised **, BLOCKS, double *messages);
typedef int Step(int64_t *, struct raised **, BLOCKS, double *messages, double t, double h, const double *u);
typedef int Show(int64_t *, struct raised **, BLOCKS, double *y);
int wide_processor(void);
typedef struct { Start *start; Step *step; Show *show, *show_links; } Kernels;
#if LINKS
#define KERNELS(level) { level##_start, level##_step, level##_show, level##_show_links }
#else
#define KERNELS(level) { level##_start, level##_step, level##_show, 0 }
#endif
#if FOR_ANY /* processor */
Start any_start; Step any_step; Show any_show, any_show_links;
static const Kernels ANY = KERNELS(any);
#endif
#if FOR_WIDE /* one, with AVX2 */
Start wide_start; Step wide_step; Show wide_show, wide_show_links;
static const Kernels WIDE = KERNELS(wide);
#endif

typedef struct { /* everything that changes during a run: saving it is copying it */
    _Alignas(64) double state[N_STATE];
    int64_t counter[N_COUNTER + 1], choice[N_STRING + 1];
    double value[N_REAL + 1], now; /* end of the last step, s; NaN: not known */
    double before[N_OUTPUT + 1], last; /* outputs one step ago; length of that step, s, 0: there was none */
    double slope[N_INPUT + 1]; /* derivatives of inputs for the next step, if sloped */
    int64_t sloped;
    int32_t phase, stale, links_stale, status;
    uint64_t numbers; /* checksum of the numbers of the instance that it belongs to */
} Data;

typedef struct { char magic[8]; uint64_t version, length, sum; char shape[72]; } NumbersHead;
typedef struct { /* of a file of numbers */
    unsigned char *content;
    uint32_t sum;
    const double *start, *x; /* start values of all Reals; initial content of the blocks */
    const int64_t *choice, *n, *k;
    const char *z, *f, *text[N_STRING + 1]; /* the floats in pieces; values of Strings without choices */
    int64_t pieces;
} Numbers;

typedef struct {
    Data d;
    double state_before[N_STATE], messages[N_MESSAGES];
    int64_t counter_before[N_COUNTER + 1];
    double started_with[N_PARAMETER + 1]; /* parameters of the last start, to which the blocks belong */
    int64_t chosen[N_STRING + 1];
    double start, stop; /* s; NaN: not given */
    double *f;
    int64_t *k;
    char *z, *name;
    Numbers numbers;
    const Kernels *run;
    Host host;
    int logging, discards; /* discards: what fails discards a step, and is no error */
    unsigned wanted; /* bits of the CATEGORY that the host wants */
} Instance;

/* ---- messages */

static void fill(char *out, size_t room, Sentence s, const double *numbers) {
    size_t n = 0;
    for (const char *p = s.text; *p && n + 1 < room; p++) {
        if (*p != '{') {
            out[n++] = *p;
            continue;
        }
        double number = numbers[p[1] - '0'];
        const char *spec = p + 3, *end = strchr(p, '}');
        char format[16];
        if (!strncmp(spec, "name", 4))
            n += (size_t)snprintf(out + n, room - n, "%s", s.names[(int)number]);
        else if (*spec == 'd' || *spec == 'n')
            n += (size_t)snprintf(out + n, room - n, "%lld", (long long)number + (*spec == 'n'));
        else {
            snprintf(format, sizeof format, "%%%.*s", (int)(end - spec), spec);
            n += (size_t)snprintf(out + n, room - n, format, number);
        }
        p = end;
    }
    out[n < room ? n : room - 1] = 0;
}

static void log_message(Instance *c, Status status, const char *category, const char *text); /* of the front end */

static void say(Instance *c, Status status, const char *text) { /* an error reaches the host whatever it wants */
    if (status == STATUS_ERROR || (c->wanted & 1u << status)) log_message(c, status, CATEGORY[status], text);
}

static Status refuse(Instance *c, const char *format, ...) {
    Status status = c->discards ? STATUS_DISCARD : STATUS_ERROR;
    char text[LONGEST];
    va_list more;
    va_start(more, format);
    vsnprintf(text, sizeof text, format, more);
    va_end(more);
    say(c, status, text);
    return status;
}

static Status choose_categories(Instance *c, int on, size_t n, const char *const categories[]) { /* none: all */
    unsigned wanted = n && on ? 0 : ~0u;
    for (size_t i = 0; i < n; i++) {
        int status = STATUS_WARNING;
        while (status <= STATUS_ERROR && (!categories[i] || strcmp(categories[i], CATEGORY[status]))) status++;
        if (status > STATUS_ERROR)
            return refuse(c, "there is no category '%s' of messages: there are %s, %s and %s", categories[i] ? categories[i] : "",
                          CATEGORY[STATUS_WARNING], CATEGORY[STATUS_DISCARD], CATEGORY[STATUS_ERROR]);
        wanted |= on ? 1u << status : 0u;
    }
    c->logging = on;
    c->wanted = wanted;
    return STATUS_OK;
}

static Status refuse_with(Instance *c, Sentence sentence, double first, double second) {
    char text[LONGEST];
    fill(text, sizeof text, sentence, (double[]){first, second});
    return refuse(c, "%s", text);
}

#include "numbers.h"

static int forbidden(Instance *c, int call) { /* 1: the phase does not allow this call of the table in phases.py */
    const char *sentence = NOT_ALLOWED[call][c->d.phase];
    if (sentence) refuse(c, "%s", sentence);
    return sentence != 0;
}
#define CHECK(call) if (forbidden(p, CALL_##call)) return (Status)STATUS_ERROR

/* ---- calls of the kernels */

static int finite(const double *a, int n) {
    double sum = 0.0;
    for (int i = 0; i < n; i++) sum += 0.0 * a[i];
    return sum == 0.0;
}

static int not_finite(Instance *c, int first, const double *a, int n, const char *what, const char *when, double t) {
    for (int i = 0; i < n; i++)
        if (!isfinite(a[i])) {
            if (when[0] == '@')
                refuse(c, "%s '%s' is %g at t = %g", what, NAME[first + i], a[i], t);
            else
                refuse(c, "%s '%s' is %g %s", what, NAME[first + i], a[i], when);
            return 1;
        }
    return 0;
}

static void warn(Instance *c) {
    char text[LONGEST];
    for (int k = 0; k < N_WARNING; k++) {
        double *row = c->messages + (k + 1) * MESSAGE_SIZE;
        if (row[0] == 0.0) continue;
        row[0] = 0.0;
        fill(text, sizeof text, WARNING[k], row + 1);
        c->d.status = WARNED;
        say(c, STATUS_WARNING, text);
    }
}

static int refresh(Instance *c, const char *when, double t) {
    double y[N_OUTPUT + 1];
    int64_t result;
    struct raised *e = 0;
    Data *d = &c->d;
    if (c->run->show(&result, &e, OF(c), y)) {
        refuse(c, "the outputs could not be computed");
        return 1;
    }
    if (!finite(y, N_OUTPUT) && not_finite(c, N_INPUT, y, N_OUTPUT, "output", when, t)) return 1;
    memcpy(d->before, d->value + N_INPUT, N_OUTPUT * sizeof *y);
    memcpy(d->value + N_INPUT, y, N_OUTPUT * sizeof *y);
    d->links_stale = N_LINK > 0;
    warn(c);
    return 0;
}

static int unacceptable(Instance *c) { /* 1: a parameter is out of its range */
    for (int i = 0; i < N_PARAMETER; i++) {
        double value = c->d.value[FIRST_PARAMETER + i];
        if (!RANGE[i].free || (isfinite(value) && RANGE[i].least <= value && value <= RANGE[i].most)) continue;
        refuse(c, "%s = %.6g: must be %s", NAME[FIRST_PARAMETER + i], value, RANGE[i].text);
        return 1;
    }
    return 0;
}

static int initialise(Instance *c) {
    Data *d = &c->d;
    int64_t refused = 0;
    struct raised *e = 0;
    char text[LONGEST];
    if (unacceptable(c)) return 1;
    memcpy(d->state, c->numbers.x, sizeof d->state);
    memcpy(d->counter, c->numbers.n, N_COUNTER * sizeof *d->counter);
    memset(c->f, 0, N_F * sizeof *c->f);
    const char *at = c->numbers.f;
    for (int64_t i = 0; i < c->numbers.pieces; i++) {
        const int64_t *piece = (const int64_t *)at;
        memcpy(c->f + piece[0], at + 16, (size_t)piece[1] * sizeof *c->f);
        at += 16 + 8 * piece[1];
    }
    memcpy(c->k, c->numbers.k, N_K * sizeof *c->k);
    memcpy(c->z, c->numbers.z, N_Z);
    memset(c->messages, 0, sizeof c->messages);
    memcpy(c->started_with, d->value + FIRST_PARAMETER, sizeof c->started_with);
    memcpy(c->chosen, d->choice, sizeof c->chosen);
    d->status = 0;
    if (c->run->start(&refused, &e, OF(c), c->messages)) {
        refuse(c, "the start could not be computed");
        return 1;
    }
    if (refused) {
        fill(text, sizeof text, REFUSED[refused], c->messages);
        refuse(c, "%s", text);
        return 1;
    }
    if (refresh(c, "at the start", 0.0)) return 1;
    d->stale = 0;
    d->last = 0.0;
    return 0;
}

static Status step(Instance *c, double t, double h) {
    Data *d = &c->d;
    int64_t failed = 0;
    struct raised *e = 0;
    char text[LONGEST];
    double u[N_INPUT + 1];
    for (int i = 0; i < N_INPUT; i++) u[i] = d->sloped ? d->value[i] + SHARE[i] * h * d->slope[i] : d->value[i];
    if (!finite(u, N_INPUT) && not_finite(c, 0, u, N_INPUT, "input", "@", t)) {
        d->status = FAILED;
        return STATUS_DISCARD;
    }
    memcpy(c->state_before, d->state, sizeof c->state_before);
    memcpy(c->counter_before, d->counter, sizeof c->counter_before);
    d->status = 0;
    if (c->run->step(&failed, &e, OF(c), c->messages, t, h, u)) {
        snprintf(text, sizeof text, "at t = %g s a kernel raised an exception", t);
    } else if (failed) {
        fill(text, sizeof text, FAILURE[failed], c->messages);
    } else if (!refresh(c, "@", t + h)) {
        d->now = t + h;
        d->last = h;
        d->sloped = 0;
        return STATUS_OK;
    } else {
        text[0] = 0; /* already logged */
    }
    warn(c); /* a warning may explain the failure */
    memcpy(d->state, c->state_before, sizeof c->state_before);
    memcpy(d->counter, c->counter_before, sizeof c->counter_before);
    if (text[0]) refuse(c, "%s", text);
    d->status = FAILED;
    return STATUS_DISCARD;
}

static Status advance(Instance *c, double t, double h) {
    double run = fabs(t - c->start), shortest = LENGTHS[0] * (run > 1.0 ? run : 1.0); /* fmax would need libm */
    double slack = shortest + ROUNDING * fabs(t);
    if (!(isfinite(t) && h >= shortest && h <= LENGTHS[1])) return refuse_with(c, STEP_REFUSED[0], t, h);
    if (fabs(t - c->d.now) > slack) return refuse_with(c, STEP_REFUSED[1], t, c->d.now);
    if (t + h - c->stop > slack) return refuse_with(c, STEP_REFUSED[2], t + h, c->stop);
    c->discards = 1;
    Status status = step(c, t, h);
    c->discards = 0;
    return status;
}

/* ---- instances */

static void begin(Instance *c) {
    memset(&c->d, 0, sizeof c->d);
    memcpy(c->d.value, c->numbers.start, N_REAL * sizeof *c->d.value);
    memcpy(c->d.choice, c->numbers.choice, N_STRING * sizeof *c->d.choice);
    c->d.numbers = c->numbers.sum;
    c->d.stale = 1;
    c->d.now = c->start = c->stop = NAN;
}

#if defined _WIN32
static void *allocate(size_t size) { return _aligned_malloc(size, 64); }
static void deallocate(void *place) { _aligned_free(place); }
#else
static void *allocate(size_t size) { return aligned_alloc(64, (size + 63) / 64 * 64); }
static void deallocate(void *place) { free(place); }
#endif

static void release(Instance *c) {
    deallocate(c->f);
    deallocate(c->k);
    deallocate(c->z);
    free(c->name);
    free(c->numbers.content);
    deallocate(c);
}

/* those for this processor; 0: the library has none, as it was built for the runs of a machine */
static const Kernels *kernels(void) {
#if FOR_WIDE
    if (wide_processor()) return &WIDE;
#endif
#if FOR_ANY
    return &ANY;
#else
    return 0;
#endif
}

/* 0: refused; resources: URI of FMI 2.0, path of FMI 3.0 */
static Instance *create(const char *name, const char *token, const char *resources, Host host, int logging) {
    Instance *c = allocate(sizeof *c);
    if (!c) return 0;
    memset(c, 0, sizeof *c);
    c->host = host;
    c->logging = logging;
    c->wanted = ~0u;
    c->run = kernels();
    c->name = malloc(strlen(name ? name : "") + 1);
    c->f = allocate(N_F * sizeof *c->f);
    c->k = allocate(N_K * sizeof *c->k);
    c->z = allocate(N_Z);
    if (c->name) strcpy(c->name, name ? name : "");
    char own[sizeof GUID] = GUID; /* of the FMU with these numbers; GUID is that of the shape */
    int of_shape = token && strlen(token) == sizeof GUID - 1 && !strncmp(token, GUID, OF_SHAPE);
    if (!c->run)
        refuse(c, "this FMU was built for runs on processors with AVX2: cotrack build --native makes one for all");
    else if (c->name && c->f && c->k && c->z && of_shape && read_numbers(c, resources)) {
        snprintf(own + OF_SHAPE, sizeof own - OF_SHAPE, "%08x", (unsigned)c->numbers.sum);
        if (!strcmp(token, own) || !strcmp(token, GUID)) {
            begin(c);
            return c;
        }
        of_shape = 0;
    }
    if (!of_shape)
        refuse(c, "the guid %s is not %s, which this FMU has", token ? token : "(none)", own);
    release(c);
    return 0;
}

static Status set_times(Instance *c, double start, int stops, double stop) {
    if (!stops) stop = NAN;
    if (!isfinite(start) || stop < start) return refuse(c, "an experiment cannot last from %g to %g s", start, stop);
    c->d.now = c->start = start;
    c->stop = stop;
    return STATUS_OK;
}

static Status enter(Instance *c, int phase) {
    c->d.phase = phase;
    return STATUS_OK;
}

static Status finish_initialisation(Instance *c) {
    if (c->d.stale && initialise(c)) return STATUS_ERROR;
    return enter(c, RUNNING);
}

/* ---- variables: Reals, Integers, Strings share one row, in which 'at' is a place */

static int started(Instance *c) { return !c->d.stale || !initialise(c); }

static int is_output(int64_t at) { return at >= N_INPUT && at < FIRST_PARAMETER; }
static int is_link(int64_t at) { return at >= FIRST_LINK && at < FIRST_PARAMETER; }

static int not_computed(Instance *c, int outputs, int links) { /* 1: outputs, or those of links, cannot be computed */
    if (outputs && !started(c)) return 1;
#if LINKS
    if (links && c->d.links_stale) {
        int64_t result;
        struct raised *e = 0;
        double *y = c->d.value + FIRST_LINK;
        if (c->run->show_links(&result, &e, OF(c), y)) {
            refuse(c, "the link outputs could not be computed");
            return 1;
        }
        if (!finite(y, N_LINK) && not_finite(c, FIRST_LINK, y, N_LINK, "output", "after the last step", 0.0))
            return 1;
        c->d.links_stale = 0;
    }
#else
    (void)links;
#endif
    return 0;
}

static Status settable(Instance *c, unsigned v, int is_free, int is_same) { /* refuses constants and late calls */
    if (!is_free && is_same) return STATUS_OK;
    if (c->d.phase == RUNNING)
        return refuse(c, "parameter '%s' is fixed: set it before the end of initialisation", NAME[v]);
    if (!is_free) return refuse(c, "'%s' is a constant of this FMU: build one with another value", NAME[v]);
    c->d.stale = 1;
    return STATUS_OK;
}

static Status settable_real(Instance *c, int64_t at, double value) {
    if (at >= FIRST_PARAMETER) return settable(c, (unsigned)at, RANGE[at - FIRST_PARAMETER].free, value == c->numbers.start[at]);
    if (at >= N_INPUT) return refuse(c, "an output cannot be set (%s or one set with it)", NAME[at]);
    return STATUS_OK;
}

/* Derivative of an output: its change over the last step by the length of that; 1: it has none. */
static int no_derivative(Instance *c, int64_t at, int order, double *to) {
    if (order != 1 || at < N_INPUT || at >= FIRST_LINK) {
        refuse(c, "'%s' has no derivative of order %d: outputs but those of links have one of order 1", NAME[at], order);
        return 1;
    }
    *to = c->d.last > 0.0 ? (c->d.value[at] - c->d.before[at - N_INPUT]) / c->d.last : 0.0;
    return 0;
}

static int64_t integer_value(Instance *c, int64_t i) { return i < N_COUNTER ? c->d.counter[i] : c->d.status; }

static const char *string_value(Instance *c, int64_t i) {
    return CHOICE[i].count ? CHOICE[i].names[c->d.choice[i]] : c->numbers.text[i];
}

static Status choose(Instance *c, unsigned v, int64_t at, int64_t k, const char *text, int keeps) { /* text: of a wrong k */
    Choice of = CHOICE[at];
    char known[LONGEST] = "";
    if (k >= 0 && k < of.count) {
        if (settable(c, v, of.free, 1)) return STATUS_ERROR;
        if (keeps) c->d.choice[at] = k;
        return STATUS_OK;
    }
    if (settable(c, v, of.free, 0)) return STATUS_ERROR;
    for (int i = 0; i < of.count; i++)
        snprintf(known + strlen(known), sizeof known - strlen(known), "%s%s", i ? ", " : "", of.names[i]);
    return refuse(c, "%s = '%s': must be one of %s", NAME[v], text, known);
}

static Status choose_text(Instance *c, unsigned v, int64_t at, const char *text, int keeps) {
    int k = 0;
    if (!CHOICE[at].count) return settable(c, v, 0, text && !strcmp(text, c->numbers.text[at]));
    while (k < CHOICE[at].count && (!text || strcmp(text, CHOICE[at].names[k]))) k++;
    return choose(c, v, at, k, text ? text : "", keeps);
}

/* ---- FMU states: their bytes begin with a checksum of all that follows, and the guid */

typedef struct { uint64_t sum; char guid[40]; Data d; } Bytes;
enum { SUMMED = sizeof(Bytes) - sizeof(uint64_t) };

static uint64_t checksum(const void *p, size_t n) { /* FNV-1a */
    const unsigned char *b = p;
    uint64_t sum = 14695981039346656037u;
    while (n--) sum = (sum ^ *b++) * 1099511628211u;
    return sum;
}

static Status get_state(Instance *c, void **to) {
    if (!*to && !(*to = allocate(sizeof(Data)))) return refuse(c, "there is no memory for a state");
    memcpy(*to, &c->d, sizeof(Data));
    return STATUS_OK;
}

static int impossible(const Data *s) { /* 1: no instance has this state */
    if (s->phase < INSTANTIATED || s->phase > TERMINATED || (s->stale && s->phase > INITIALISING)) return 1;
    for (int i = 0; i < N_STRING; i++)
        if (s->choice[i] < 0 || (s->choice[i] && s->choice[i] >= CHOICE[i].count)) return 1;
    for (int i = 0; i < N_COUNTER; i++)
        if (s->counter[i] < 0) return 1;
    for (int i = 0; i < N_INDEX && !s->stale; i++) {
        double at = s->state[INDEX[i].place];
        if (!(at >= 0.0 && at < INDEX[i].count && at == floor(at))) return 1;
    }
    return !finite(s->state, N_STATE) || !finite(s->value + N_INPUT, N_OUTPUT + N_LINK) || !finite(s->before, N_OUTPUT) ||
           !finite(s->slope, N_INPUT) || !(s->last >= 0.0 && isfinite(s->last));
}

static Status set_state(Instance *c, const void *from) {
    const Data *s = from;
    if (!s) return refuse(c, "this is not a state of an FMU of this build");
    if (s->numbers != c->numbers.sum) return refuse(c, "the state is one of an instance with other numbers");
    if (impossible(s)) return refuse(c, "these bytes are not a saved state of this FMU: values that it cannot have");
    if (!s->stale && (c->d.stale || memcmp(c->started_with, s->value + FIRST_PARAMETER, sizeof c->started_with) ||
                      memcmp(c->chosen, s->choice, sizeof c->chosen))) { /* blocks of another start, or of none */
        Data *before = allocate(sizeof *before);
        if (!before) return refuse(c, "there is no memory for a state");
        memcpy(before, &c->d, sizeof *before);
        memcpy(c->d.value, s->value, sizeof c->d.value);
        memcpy(c->d.choice, s->choice, sizeof c->d.choice);
        int failed = initialise(c);
        if (failed) { /* back to the parameters and the state before */
            memcpy(&c->d, before, sizeof *before);
            if (!before->stale) initialise(c);
            memcpy(&c->d, before, sizeof *before);
        }
        deallocate(before);
        if (failed) return STATUS_ERROR;
    }
    memcpy(&c->d, s, sizeof(Data));
    return STATUS_OK;
}

static Status free_state(void **state) {
    if (state) {
        deallocate(*state);
        *state = 0;
    }
    return STATUS_OK;
}

static Status serialise(Instance *c, const void *state, void *to, size_t n) {
    char *bytes = to; /* which need not be aligned */
    if (!state || n < sizeof(Bytes)) return refuse(c, "a state needs %zu bytes", sizeof(Bytes));
    memset(bytes, 0, sizeof(Bytes));
    strcpy(bytes + offsetof(Bytes, guid), GUID);
    memcpy(bytes + offsetof(Bytes, d), state, sizeof(Data));
    uint64_t sum = checksum(bytes + offsetof(Bytes, guid), SUMMED);
    memcpy(bytes, &sum, sizeof sum);
    return STATUS_OK;
}

static Status deserialise(Instance *c, const void *bytes, size_t n, void **to) {
    const char *from = bytes;
    uint64_t sum;
    if (n != sizeof(Bytes)) return refuse(c, "these bytes are not a saved state of this FMU");
    memcpy(&sum, from, sizeof sum);
    if (sum != checksum(from + offsetof(Bytes, guid), SUMMED))
        return refuse(c, "these bytes are not a saved state: the checksum does not hold");
    if (strncmp(from + offsetof(Bytes, guid), GUID, sizeof GUID))
        return refuse(c, "the state belongs to another FMU than %s", GUID);
    if (!*to && !(*to = allocate(sizeof(Data)))) return refuse(c, "there is no memory for a state");
    memcpy(*to, from + offsetof(Bytes, d), sizeof(Data));
    return STATUS_OK;
}
