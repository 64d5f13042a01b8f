// The part of Companion that a module talks to: starts the module as a process, and keeps what it says.

import { fork } from 'node:child_process'
import { createRequire } from 'node:module'
import { dirname, join } from 'node:path'
import { fileURLToPath } from 'node:url'

const root = dirname(dirname(fileURLToPath(import.meta.url)))
const base = dirname(createRequire(import.meta.url).resolve('@companion-module/base'))
const { IpcWrapper } = createRequire(import.meta.url)(join(base, 'host-api/ipc-wrapper.js'))

/** Longest wait for something that the module does, in milliseconds. Only a failing test waits this long. */
const WAIT_MS_MAX = 20_000

/** A running module. Its fields have the latest of what the module says. */
export class Host {
	actions = {}
	feedbacks = {}
	presets = {}
	variables = {}
	values = {}
	flags = {}
	status = null
	log = []
	#child
	#ipc
	#waiting = new Set()

	/** Starts the module with the configuration `config`. */
	static async start(config) {
		const host = new Host()
		await host.#start(config)
		return host
	}

	async #start(config) {
		const env = {
			...process.env,
			CONNECTION_ID: 'test',
			VERIFICATION_TOKEN: 'test',
			MODULE_MANIFEST: join(root, 'companion/manifest.json'),
		}
		this.#child = fork(join(root, 'src/main.js'), [], { env, silent: true })
		const byId = (list) => Object.fromEntries(list.map((item) => [item.id, item]))
		let registered
		const registration = new Promise((done) => (registered = done))
		const handlers = {
			register: async () => registered(),
			'log-message': async ({ level, message }) => this.log.push(`${level}: ${message}`),
			'set-status': async (status) => (this.status = status),
			setActionDefinitions: async ({ actions }) => (this.actions = byId(actions)),
			setFeedbackDefinitions: async ({ feedbacks }) => (this.feedbacks = byId(feedbacks)),
			setPresetDefinitions: async ({ presets }) => (this.presets = byId(presets)),
			setVariableDefinitions: async ({ variables }) => (this.variables = byId(variables)),
			setVariableValues: async ({ newValues }) => newValues.forEach(({ id, value }) => (this.values[id] = value)),
			updateFeedbackValues: async ({ values }) => values.forEach(({ id, value }) => (this.flags[id] = value)),
		}
		this.#ipc = new IpcWrapper(handlers, (message) => this.#child.send(message), WAIT_MS_MAX)
		this.#child.on('message', (message) => {
			this.#ipc.receivedMessage(message)
			// The handlers run first.
			setImmediate(() => this.#waiting.forEach((check) => check()))
		})
		await registration
		// The module must receive the answer to its registration first.
		await new Promise((done) => setImmediate(done))
		await this.#ipc.sendWithCb('init', {
			label: 'corybant',
			isFirstInit: false,
			config,
			secrets: {},
			lastUpgradeIndex: -1,
			feedbacks: {},
			actions: {},
		})
	}

	/** Waits until `ready()` returns a value that is not false; returns it. */
	until(what, ready) {
		return new Promise((done, fail) => {
			const timer = setTimeout(() => end(fail, new Error(`${what} did not come; ${JSON.stringify([this.status, this.values])}`)), WAIT_MS_MAX)
			const end = (how, value) => {
				clearTimeout(timer)
				this.#waiting.delete(check)
				how(value)
			}
			const check = () => {
				const value = ready()
				if (value) end(done, value)
			}
			this.#waiting.add(check)
			check()
		})
	}

	/** Puts a feedback on a button; its value is in `flags[id]` from then on. */
	async addFeedback(id, feedbackId, options = {}) {
		const feedback = { id, controlId: 'button', feedbackId, options, disabled: false, isInverted: false, upgradeIndex: null }
		await this.#ipc.sendWithCb('updateFeedbacks', { feedbacks: { [id]: feedback } })
	}

	/** Presses a button with an action. */
	press(actionId, options = {}) {
		const action = { id: 'action', controlId: 'button', actionId, options, disabled: false, upgradeIndex: null }
		return this.#ipc.sendWithCb('executeAction', { action, surfaceId: undefined })
	}

	/** Presses the button of a preset. */
	pressPreset(id) {
		const { actionId, options } = this.presets[id].steps[0].down[0]
		return this.press(actionId, options)
	}

	configFields() {
		return this.#ipc.sendWithCb('getConfigFields', {})
	}

	configure(config) {
		return this.#ipc.sendWithCb('updateConfigAndLabel', { label: 'corybant', config, secrets: {} })
	}

	async stop() {
		await this.#ipc.sendWithCb('destroy', {})
		this.#child.kill()
	}
}
