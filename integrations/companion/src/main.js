// The Companion module: connects the definitions to a show.

import { InstanceBase, InstanceStatus, Regex, runEntrypoint } from '@companion-module/base'
import { actions, feedbacks, presets, values, VARIABLES } from './definitions.js'
import { Show } from './show.js'

/** What a show without labels says; used before the first connection. */
const NOTHING = { labels: [], sources: ['audio'], scenes: [], songs: [] }

class Corybant extends InstanceBase {
	#show = null
	#state = null
	#beat = null
	#labels = ''

	async init(config) {
		this.setVariableDefinitions(VARIABLES)
		this.#define(NOTHING)
		await this.configUpdated(config)
	}

	async configUpdated({ host, port, token }) {
		this.#show?.close()
		if (!host) {
			this.updateStatus(InstanceStatus.BadConfig, 'enter the address of the show')
			return
		}
		this.updateStatus(InstanceStatus.Connecting)
		const show = new Show({ host, port: port || 8710, token })
		this.#show = show
		show.on('about', (about) => {
			this.updateStatus(InstanceStatus.Ok)
			this.#define(about)
		})
		show.on('state', (state) => this.#update(state))
		show.on('beat', (beat) => {
			this.#beat = beat
			this.checkFeedbacks('downbeat')
		})
		show.on('lost', (why) => {
			this.#state = this.#beat = null
			this.updateStatus(InstanceStatus.ConnectionFailure, why)
			this.checkFeedbacks()
		})
	}

	async destroy() {
		this.#show?.close()
	}

	getConfigFields() {
		return [
			{ type: 'textinput', id: 'host', label: 'Address of the show', width: 8, default: '127.0.0.1' },
			{ type: 'textinput', id: 'port', label: 'Port', width: 4, default: '8710', regex: Regex.PORT },
			{ type: 'textinput', id: 'token', label: 'Token (page.play_token or page.token)', width: 12, default: '' },
		]
	}

	#define(about) {
		const labels = JSON.stringify([about.labels, about.sources])
		if (labels === this.#labels) return
		this.#labels = labels
		const send = (command, body) => this.#send(command, body)
		this.setActionDefinitions(actions(about, send, () => this.#state))
		this.setFeedbackDefinitions(feedbacks(about, () => this.#state, () => this.#beat))
		this.setPresetDefinitions(presets(about))
	}

	async #send(command, body) {
		try {
			if (!this.#show) throw new Error('there is no address of a show')
			await this.#show.send(command, body)
		} catch (error) {
			this.log('error', `${command}: ${error.cause?.message || error.message}`)
		}
	}

	#update(state) {
		this.#state = state
		this.setVariableValues(values(state))
		this.checkFeedbacks()
	}
}

runEntrypoint(Corybant, [])
