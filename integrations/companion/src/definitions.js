// Actions, feedbacks, variables and presets for the labels of a show. Plain data and functions of the last state.

import { combineRgb } from '@companion-module/base'

const WHITE = combineRgb(255, 255, 255)
const BLACK = combineRgb(0, 0, 0)
const GREEN = combineRgb(0, 140, 60)
const BLUE = combineRgb(20, 50, 110)
const RED = combineRgb(180, 0, 0)
const AMBER = combineRgb(220, 150, 0)

/** The states of a pad. */
const PAD_STATES = [
	{ id: 'danced', label: 'is danced' },
	{ id: 'armed', label: 'is armed (waits or runs, but is not danced now)' },
]
const QUANTISES = ['beat', 'now', 'bar', '2bars', '4bars', '8bars', 'phrase']
/** The sections of the music. */
const SECTIONS = ['intro', 'groove', 'build-up', 'drop', 'breakdown', 'outro']
const MODES = ['trigger', 'toggle', 'repeat']
/** Buttons without an option: name of the action, its text, its command and body. */
const BUTTONS = [
	['panic', 'Panic: ease into idle', 'panic'],
	['release', 'Go on after a panic or a hold', 'release'],
	['tap', 'Tap: a beat is now', 'tempo', { value: 'tap' }],
	['half', 'Half as many beats', 'tempo', { value: 'half' }],
	['double', 'Twice as many beats', 'tempo', { value: 'double' }],
	['downbeat', 'The nearest beat begins the bar', 'tempo', { value: 'downbeat' }],
	['scene_end', 'End the scene', 'scene_end'],
	['go', 'GO: start the next song', 'go'],
	['back', 'Back to the song before', 'back'],
	['set_hold', 'Hold the cue list of the song, or go on', 'set_hold'],
]

const choices = (list) => list.map((id) => ({ id, label: id }))

function labelOption(labels, isOwn = true) {
	return { type: 'dropdown', id: 'label', label: 'Label', choices: choices(labels), default: labels[0] ?? '', allowCustom: isOwn }
}

/** The actions. `send(command, body)` sends a command; `state()` returns the last state or null. */
export function actions(about, send, state) {
	const definitions = {
		cue: {
			name: 'Dance a label',
			options: [
				labelOption(about.labels),
				{ type: 'number', id: 'beats', label: 'Beats', default: 8, min: 1, max: 1024 },
				{ type: 'dropdown', id: 'mode', label: 'Mode', choices: choices(MODES), default: 'trigger' },
				{ type: 'dropdown', id: 'quantise', label: 'Starts at the next', choices: choices(QUANTISES), default: 'beat' },
				{ type: 'checkbox', id: 'queue', label: 'After all other cues', default: false },
				{ type: 'checkbox', id: 'avoid', label: 'Avoid the label instead', default: false },
			],
			callback: ({ options: { label, beats, mode, quantise, queue, avoid } }) =>
				send('cue', { label, beats, mode, quantise, queue, avoid }),
		},
		cancel: {
			name: 'Remove all cues for a label',
			options: [labelOption(about.labels)],
			callback: ({ options: { label } }) => send('cancel', { label }),
		},
		hold: {
			name: 'Hold: loop the current motion',
			options: [{ type: 'dropdown', id: 'on', label: 'Hold', choices: choices(['toggle', 'on', 'off']), default: 'toggle' }],
			callback: ({ options: { on } }) => send('hold', { value: on === 'toggle' ? !state()?.held : on === 'on' }),
		},
		intensity: {
			name: 'Intensity of the dance',
			options: [
				{ type: 'checkbox', id: 'music', label: 'By the music', default: false },
				{ type: 'number', id: 'percent', label: 'Percent', default: 70, min: 0, max: 100, range: true },
			],
			callback: ({ options: { music, percent } }) => send('intensity', { value: music ? null : percent / 100 }),
		},
		bpm: {
			name: 'Tempo',
			options: [{ type: 'number', id: 'bpm', label: 'Beats per minute', default: 120, min: 20, max: 400, step: 0.1 }],
			callback: ({ options: { bpm } }) => send('tempo', { value: `bpm ${bpm}` }),
		},
		nudge: {
			name: 'Move the beats',
			options: [{ type: 'number', id: 'ms', label: 'Milliseconds later (below 0: earlier)', default: 10, min: -500, max: 500 }],
			callback: ({ options: { ms } }) => send('tempo', { value: `nudge ${ms}` }),
		},
		source: {
			name: 'Tempo source',
			options: [{ type: 'dropdown', id: 'source', label: 'Source', choices: choices(about.sources), default: about.sources[0] ?? 'audio' }],
			callback: ({ options: { source } }) => send('tempo', { value: `source ${source}` }),
		},
		scene: {
			name: 'Recall a scene',
			options: [{ type: 'dropdown', id: 'scene', label: 'Scene', choices: choices(about.scenes), default: about.scenes[0] ?? '', allowCustom: true }],
			callback: ({ options: { scene } }) => send('scene', { value: scene }),
		},
		jump: {
			name: 'Start a song of the set list',
			options: [{ type: 'dropdown', id: 'song', label: 'Song', choices: choices(about.songs), default: about.songs[0] ?? '', allowCustom: true }],
			callback: ({ options: { song } }) => send('jump', { value: song }),
		},
	}
	for (const [id, name, command, body] of BUTTONS) {
		definitions[id] = { name, options: [], callback: () => send(command, body) }
	}
	return definitions
}

/** The state of the pad of `label`: `danced`, `armed` or `idle`. */
export function padState(state, label) {
	const cues = (state?.cues ?? []).filter((cue) => cue.label === label)
	if (cues.some((cue) => cue.dancing)) return 'danced'
	return cues.length > 0 ? 'armed' : 'idle'
}

/** The feedbacks. `state()` returns the last state or null; `beat()` the last beat event or null. */
export function feedbacks(about, state, beat) {
	const flag = (name, bgcolor, callback, options = []) => ({
		type: 'boolean',
		name,
		options,
		defaultStyle: { bgcolor, color: WHITE },
		callback,
	})
	return {
		pad: flag('The pad of a label', GREEN, ({ options }) => padState(state(), options.label) === options.state, [
			labelOption(about.labels),
			{ type: 'dropdown', id: 'state', label: 'State', choices: PAD_STATES, default: 'danced' },
		]),
		label: flag('A label is danced', GREEN, ({ options }) => state()?.label === options.label, [labelOption(about.labels)]),
		held: flag('Hold is on', AMBER, () => Boolean(state()?.held)),
		panicked: flag('Panic is on', RED, () => Boolean(state()?.panicked)),
		music: flag('There is music', GREEN, () => Boolean(state()?.music)),
		warning: flag('The show warns', RED, () => (state()?.warnings ?? []).length > 0),
		scene: flag('A scene is on', GREEN, ({ options }) => state()?.scene === options.scene, [
			{ type: 'dropdown', id: 'scene', label: 'Scene', choices: choices(about.scenes), default: about.scenes[0] ?? '', allowCustom: true },
		]),
		section: flag('A section of the music plays', BLUE, ({ options }) => state()?.section?.name === options.section, [
			{ type: 'dropdown', id: 'section', label: 'Section', choices: choices(SECTIONS), default: 'drop' },
		]),
		set_held: flag('The cue list of the song is held', AMBER, () => Boolean(state()?.set?.held)),
		song_waits: flag('A song waits for its bar', AMBER, () => typeof state()?.set?.beats_left === 'number'),
		downbeat: flag('The first beat of the bar is now', WHITE, () => beat()?.bar === 0),
	}
}

/** The definitions of the variables. */
export const VARIABLES = [
	{ variableId: 'label', name: 'Label that is danced' },
	{ variableId: 'clip', name: 'Clip that is danced' },
	{ variableId: 'next_cue', name: 'Label of the first cue that is not danced' },
	{ variableId: 'bpm', name: 'Tempo, beats per minute' },
	{ variableId: 'beat_of_bar', name: 'Beat of the bar, from 1' },
	{ variableId: 'energy', name: 'Energy of the music, percent' },
	{ variableId: 'intensity', name: 'Intensity, percent, or "music"' },
	{ variableId: 'confidence', name: 'Confidence of the beats, percent' },
	{ variableId: 'source', name: 'Tempo source' },
	{ variableId: 'scene', name: 'Scene' },
	{ variableId: 'section', name: 'Section of the music' },
	{ variableId: 'next_section', name: 'Section that the music announces' },
	{ variableId: 'beats_to_section', name: 'Beats until that section' },
	{ variableId: 'phrase', name: 'Beat of the phrase, from 1, and its length' },
	{ variableId: 'song', name: 'Song' },
	{ variableId: 'next_song', name: 'Next song' },
	{ variableId: 'song_beat', name: 'Beat of the song' },
	{ variableId: 'warning', name: 'First warning' },
]

/** The values of the variables. */
export function values(state) {
	const percent = (x) => (x === null || x === undefined ? undefined : Math.round(100 * x))
	return {
		label: state.label ?? state.motion,
		clip: state.clip ?? '',
		next_cue: state.cues.find((cue) => !cue.dancing)?.label ?? '',
		bpm: state.bpm === null ? undefined : Math.round(10 * state.bpm) / 10,
		beat_of_bar: state.bar + 1,
		energy: percent(state.energy),
		intensity: state.intensity === null ? 'music' : percent(state.intensity),
		confidence: percent(state.confidence),
		source: state.source,
		scene: state.scene ?? '',
		section: state.section?.name ?? '',
		next_section: state.next_section?.name ?? '',
		beats_to_section: state.next_section ? Math.max(Math.ceil(state.next_section.beat - state.beat), 0) : '',
		phrase: `${state.phrase.beat + 1}/${state.phrase.beats}`,
		song: state.set?.song ?? '',
		next_song: state.set?.next_song ?? '',
		song_beat: Math.floor(state.set?.beat ?? 0),
		warning: state.warnings[0] ?? '',
	}
}

/** The presets: one button for each label, and the buttons of the show. */
export function presets(about) {
	const button = (category, name, text, action, feedbacks = [], size = 'auto') => ({
		type: 'button',
		category,
		name,
		style: { text, size, color: WHITE, bgcolor: BLACK },
		steps: [{ down: [action], up: [] }],
		feedbacks,
	})
	const found = {}
	about.labels.forEach((label, n) => {
		const options = { label, beats: 8, mode: 'trigger', quantise: 'beat', queue: false, avoid: false }
		const pad = (state, bgcolor) => ({ feedbackId: 'pad', options: { label, state }, style: { bgcolor } })
		const category = label.includes('/') ? `Pads: ${label.slice(0, label.indexOf('/'))}` : 'Pads'
		const shown = label.slice(label.indexOf('/') + 1)
		found[`pad_${n}`] = button(category, label, shown, { actionId: 'cue', options }, [pad('armed', BLUE), pad('danced', GREEN)])
	})
	const simple = (id, text, feedbacks) => (found[id] = button('Show', text, text, { actionId: id, options: {} }, feedbacks))
	const on = (feedbackId, bgcolor) => [{ feedbackId, options: {}, style: { bgcolor } }]
	simple('panic', 'PANIC', on('panicked', RED))
	simple('release', 'GO ON')
	found.hold = button('Show', 'HOLD', 'HOLD', { actionId: 'hold', options: { on: 'toggle' } }, on('held', AMBER))
	for (const percent of [30, 60, 100]) {
		const action = { actionId: 'intensity', options: { music: false, percent } }
		found[`intensity_${percent}`] = button('Show', `Intensity ${percent} %`, `${percent} %`, action)
	}
	const music = { actionId: 'intensity', options: { music: true, percent: 70 } }
	found.intensity_music = button('Show', 'Intensity by the music', 'MUSIC', music)
	about.scenes.forEach((scene, n) => {
		const feedback = { feedbackId: 'scene', options: { scene }, style: { bgcolor: GREEN } }
		found[`scene_${n}`] = button('Scenes', scene, scene, { actionId: 'scene', options: { scene } }, [feedback])
	})
	if (about.scenes.length > 0) found.scene_end = button('Scenes', 'End the scene', 'END', { actionId: 'scene_end', options: {} })
	const set = (id, text, feedbacks) => (found[id] = button('Set list', id, text, { actionId: id, options: {} }, feedbacks))
	if (about.songs.length > 0) {
		set('go', 'GO\\n$(corybant:next_song)', on('song_waits', AMBER))
		set('back', 'BACK')
		set('set_hold', 'HOLD\\n$(corybant:song)', on('set_held', AMBER))
	}
	about.songs.forEach((song, n) => {
		found[`song_${n}`] = button('Set list', song, song, { actionId: 'jump', options: { song } })
	})
	const tempo = (id, text, feedbacks) => (found[id] = button('Tempo', text, text, { actionId: id, options: {} }, feedbacks))
	tempo('tap', 'TAP\\n$(corybant:bpm)', [{ feedbackId: 'downbeat', options: {}, style: { bgcolor: WHITE, color: BLACK } }])
	tempo('half', 'HALF')
	tempo('double', 'DOUBLE')
	tempo('downbeat', 'ONE')
	return found
}
