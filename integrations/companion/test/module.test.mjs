// Tests of the module against a running show, whose page is at CORYBANT_PAGE (HOST:PORT). The show has the built-in motions, a fixed tempo,
// the scene `calm` and the songs `Opening` and `Ballad`.

import assert from 'node:assert/strict'
import { readFileSync } from 'node:fs'
import { createServer } from 'node:http'
import { createRequire } from 'node:module'
import { after, before, test } from 'node:test'
import { Host } from './host.mjs'

const page = process.env.CORYBANT_PAGE
if (!page) throw new Error('CORYBANT_PAGE is not set: start corybant, and set it to HOST:PORT of the page')
const [host, port] = page.split(':')
let companion

before(async () => {
	companion = await Host.start({ host, port, token: '' })
	await companion.until('the connection', () => companion.status?.status === 'ok')
	await companion.until('the first state', () => companion.values.bpm)
})
after(() => companion.stop())

test('the manifest is valid', () => {
	const { validateManifest } = createRequire(import.meta.url)('@companion-module/base')
	const manifest = JSON.parse(readFileSync(new URL('../companion/manifest.json', import.meta.url)))
	validateManifest(manifest, true)
})

test('there is a preset for each pad, and each of its actions and feedbacks exists', async () => {
	const about = await (await fetch(`http://${page}/api`)).json()
	const pads = Object.values(companion.presets).filter((preset) => preset.category.startsWith('Pads'))
	assert.equal(pads.length, about.labels.length)
	assert.deepEqual(pads.map((preset) => preset.name), about.labels)
	for (const preset of Object.values(companion.presets)) {
		for (const action of preset.steps[0].down) {
			const options = companion.actions[action.actionId].options.map((option) => option.id)
			assert.deepEqual(Object.keys(action.options).sort(), options.sort(), preset.name)
		}
		for (const feedback of preset.feedbacks) assert.ok(companion.feedbacks[feedback.feedbackId], preset.name)
	}
	assert.deepEqual(Object.keys(companion.values).sort(), Object.keys(companion.variables).sort())
})

test('a pad is armed, then danced, and its feedbacks and variables follow', async () => {
	await companion.addFeedback('armed', 'pad', { label: 'salsa', state: 'armed' })
	await companion.addFeedback('danced', 'pad', { label: 'salsa', state: 'danced' })
	await companion.addFeedback('other', 'pad', { label: 'robot', state: 'danced' })
	await companion.until('the values', () => companion.flags.danced === false && companion.flags.other === false)
	const salsa = Object.entries(companion.presets).find(([, preset]) => preset.name === 'salsa')[0]
	await companion.pressPreset(salsa)
	await companion.until('an armed or danced pad', () => companion.flags.armed || companion.flags.danced)
	await companion.until('the dance', () => companion.flags.danced && companion.values.label === 'salsa')
	assert.equal(companion.flags.other, false)
	await companion.press('cancel', { label: 'salsa' })
	await companion.until('the end', () => !companion.flags.danced && !companion.flags.armed)
})

test('hold, panic and go on', async () => {
	await companion.addFeedback('held', 'held')
	await companion.addFeedback('panicked', 'panicked')
	await companion.pressPreset('hold')
	await companion.until('the hold', () => companion.flags.held)
	await companion.pressPreset('hold')
	await companion.until('the end of the hold', () => !companion.flags.held)
	await companion.pressPreset('panic')
	await companion.until('the panic', () => companion.flags.panicked)
	await companion.pressPreset('release')
	await companion.until('the end of the panic', () => !companion.flags.panicked)
})

test('intensity and tempo', async () => {
	await companion.pressPreset('intensity_30')
	await companion.until('the intensity', () => companion.values.intensity === 30)
	await companion.pressPreset('intensity_music')
	await companion.until('the intensity of the music', () => companion.values.intensity === 'music')
	await companion.press('bpm', { bpm: 128 })
	await companion.until('the tempo', () => companion.values.bpm === 128)
	await companion.addFeedback('downbeat', 'downbeat')
	await companion.until('a downbeat', () => companion.flags.downbeat)
	await companion.until('another beat', () => !companion.flags.downbeat)
})

test('scenes are recalled, and GO starts the songs of the set list', async () => {
	await companion.addFeedback('calm', 'scene', { scene: 'calm' })
	const calm = Object.entries(companion.presets).find(([, preset]) => preset.category === 'Scenes' && preset.name === 'calm')[0]
	await companion.pressPreset(calm)
	await companion.until('the scene', () => companion.flags.calm && companion.values.scene === 'calm')
	await companion.pressPreset('scene_end')
	await companion.until('the end of the scene', () => !companion.flags.calm)
	assert.equal(companion.values.next_song, 'Opening')
	await companion.pressPreset('go')
	await companion.until('the first song', () => companion.values.song === 'Opening' && companion.values.next_song === 'Ballad')
	await companion.addFeedback('set_held', 'set_held')
	await companion.pressPreset('set_hold')
	await companion.until('the hold of the song', () => companion.flags.set_held)
	await companion.press('jump', { song: 'Ballad' })
	await companion.until('the second song', () => companion.values.song === 'Ballad' && !companion.flags.set_held)
	assert.match(companion.values.phrase, /^\d+\/\d+$/)
})

test('a refused command is in the log, with its reason', async () => {
	const before = companion.log.length
	await companion.press('cue', { label: 'no such', beats: 8, mode: 'trigger', quantise: 'beat', queue: false, avoid: false })
	await companion.until('the reason', () => companion.log.slice(before).some((line) => line.includes('there is no label `no such`')))
})

test('a wrong address, another server and no address are told, and the right address works again', async () => {
	const other = createServer((_, answer) => answer.end('{"name":"another"}'))
	await new Promise((done) => other.listen(0, '127.0.0.1', done))
	await companion.configure({ host: '127.0.0.1', port: String(other.address().port), token: '' })
	await companion.until('the refusal', () => companion.status.message?.includes('not a Corybant'))
	other.close()
	await companion.configure({ host: '127.0.0.1', port: '1', token: '' })
	await companion.until('the failure', () => companion.status.status === 'connection_failure' && !companion.status.message?.includes('not a Corybant'))
	await companion.configure({ host: '', port, token: '' })
	assert.equal(companion.status.status, 'bad_config')
	await companion.configure({ host, port, token: '' })
	await companion.until('the connection', () => companion.status.status === 'ok')
	const { fields } = await companion.configFields()
	assert.deepEqual(fields.map((field) => field.id), ['host', 'port', 'token'])
})
